"""Whether a device may be armed with a field: what the certificate, the device and its calibration say."""

from pathlib import Path

from controllers.certificates.loop.hand import HandRange
from controllers.certificates.report import Certificate, ChangedInputs
from experiments.certify.certified_clips import run_and_clips
from experiments.certify.certified_field import certificate_inputs, certified_options
from experiments.config.run_config import RunConfig
from experiments.files.certificate_files import changed_options, verify_certificate
from experiments.files.device_files import Calibration, linkage_of
from experiments.hardware.run_options import RunHardware
from experiments.setups.certified_law import of_clips
from models.mocap.clip import Clip
from sim.devices.driver import DeviceIdentity
from sim.errors import SimError

HAND_PUSH = 1.0  # the default of `hvf certify` [N]
RAMP = 0.25
"""Least time in which a real device's force comes in [s]: somebody who is surprised takes as long to let go."""


def verified(certificate: Path, config: RunConfig, delay: float) -> Certificate:
    """The certificate of a field, if it is of this one, on this device, and says that the loop is stable.

    Parameters
    ----------
    certificate : Path
        A folder of ``hvf certify``, or its certificate.json.
    config : RunConfig
        Of the field.
    delay : float
        Of the torques [s].

    Raises
    ------
    CertificateError
        If there is none there.
    ChangedInputs
        If it is of another field, device, delay or code.
    SimError
        If it does not say that the loop is stable, or not for the delay of the device's file.
    """
    file = certificate / "certificate.json" if certificate.is_dir() else certificate
    found_delay = linkage_of(config.device).delay
    if delay < found_delay:
        raise SimError(
            f"the device file tells of a delay of {found_delay:.2g} s; expected --delay {found_delay:.2g} or more, "
            "here and in hvf certify"
        )
    clips: tuple[Clip, ...] = ()
    if of_clips(config):
        config, clips = run_and_clips(None, config)
    try:
        found = verify_certificate(file, certificate_inputs(config, delay, HandRange(), HAND_PUSH, clips))
    except ChangedInputs:
        differ = changed_options(file, certified_options(config, delay, HandRange(), HAND_PUSH))
        if not differ:
            raise
        raise ChangedInputs(f"{file} certifies another field or device: {differ}; certify this one") from None
    stable = {name: verdict for name, verdict in found.verdicts.items() if name.startswith("stability")}
    if not stable:
        raise SimError(f"{file}: says nothing of stability; expected the certificate of a field")
    for name, verdict in stable.items():
        if verdict.verdict != "certified":
            raise SimError(f"{file}: {name} is {verdict.verdict}, so no device is armed with it; {verdict.reason}")
    return found


def check_limits(options: RunHardware) -> None:
    """Refuse limits that are none to a hand on a real device: a person may lower them, and raise them this far.

    Raises
    ------
    SimError
        With the option, and how far it goes.
    """
    for name, most, unit in (
        ("force", 8.5, "N, the Premium's peak"), ("speed", 2.0, "m/s"), ("small", 2.0, "N"),
        ("silence", 5.0, "periods"),
    ):  # fmt: skip
        value = getattr(options, name)
        if value > most:
            raise SimError(
                f"--{name} {value:g} is too much for a hand on a real device; expected at most {most:g} {unit}"
            )
    if options.ramp < RAMP:
        raise SimError(
            f"--ramp {options.ramp:g} is too quick for a hand on a real device; expected {RAMP:g} s or more, a reaction"
        )


def check_device(identity: DeviceIdentity, calibration: Calibration | None, identified: bool = False) -> list[str]:
    """What is to be said of a device that may be armed, with the zero, and the friction and inertia, of its file.

    Raises
    ------
    SimError
        If it may not: it has no motors, or nobody knows where its encoders' zero is.
    """
    if not identity.forces:
        raise SimError(f"{identity.name} has no motors: no force can be felt on it; it plays, it is not armed")
    if calibration is None and not identity.calibrated:
        raise SimError(
            f"{identity.name} is not calibrated: its encoders do not know their zero; expected a --device-file that "
            "hvf hardware calibrate has written"
        )
    if calibration is not None and calibration.why_not(identity):
        raise SimError(
            f"the device file {calibration.why_not(identity)}, this is {identity.name} {identity.serial}".rstrip()
            + "; calibrate it with hvf hardware calibrate"
        )
    said: list[str] = []
    if not identity.watchdog:
        said.append(
            f"{identity.name} has no watchdog of its own: if this machine stops, its motors keep their last torque; "
            "keep its power switch within reach"
        )
    if identity.own_weight and not identified:
        said.append(
            f"{identity.name} is no Phantom by build, and the certificate is for the friction and inertia of one; find "
            "out its own with hvf hardware identify, and certify with that --device-file; hold it firmly until then"
        )
    return said
