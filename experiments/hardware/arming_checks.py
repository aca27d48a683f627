"""Checks whether a device may be armed with a field: certificate, limits, device and calibration."""

from pathlib import Path

from controllers.certificates.loop.hand import HandRange
from controllers.certificates.report import Certificate, ChangedInputs
from controllers.errors import ParameterError
from experiments.certify.certified_clips import run_and_clips
from experiments.certify.certified_field import certificate_inputs, certified_options
from experiments.config.options import given_options
from experiments.config.run_config import FIGURE_DEFAULTS, RunConfig, meaningless_options
from experiments.files.certificate_files import changed_options, verify_certificate
from experiments.files.device_files import Calibration, linkage_of
from experiments.hardware.run_options import EMULATED, RunHardware, check_emulate
from experiments.setups.certified_law import depends_on_clips
from models.mocap.motion.clip import Clip
from sim.devices.driver import DeviceIdentity
from sim.errors import SimError

DEFAULT_HAND_PUSH = 1.0  # [N], the default of `hvf certify`
FORCE_RAMP_TIME = 0.25
"""Shortest ramp of a real device's force [s]: the reaction time in which a surprised person lets go."""


def verified(certificate: Path, config: RunConfig, delay: float) -> Certificate:
    """Read a certificate and check that it is for this field on this device, and that it certifies stability.

    Parameters
    ----------
    certificate : Path
        A folder of ``hvf certify``, or its certificate.json.
    config : RunConfig
        Configuration of the field.
    delay : float
        Delay of the torques [s].

    Raises
    ------
    CertificateError
        If there is no certificate.
    ChangedInputs
        If it is for another field, device, delay or code.
    SimError
        If it does not certify that the loop is stable, or `delay` is less than that of the device file.
    """
    file = certificate / "certificate.json" if certificate.is_dir() else certificate
    found_delay = linkage_of(config.device).delay
    if delay < found_delay:
        raise SimError(
            f"the device file has a delay of {found_delay:.2g} s; expected --delay {found_delay:.2g} or more, "
            "here and in hvf certify"
        )
    clips: tuple[Clip, ...] = ()
    if depends_on_clips(config):
        config, clips = run_and_clips(None, config)
    try:
        found = verify_certificate(file, certificate_inputs(config, delay, HandRange(), DEFAULT_HAND_PUSH, clips))
    except ChangedInputs:
        changes = changed_options(file, certified_options(config, delay, HandRange(), DEFAULT_HAND_PUSH))
        if not changes:
            raise
        raise ChangedInputs(f"{file} certifies another field or device: {changes}; certify this one") from None
    stable = {name: verdict for name, verdict in found.verdicts.items() if name.startswith("stability")}
    if not stable:
        raise SimError(f"{file}: has no verdict on stability; expected the certificate of a field")
    for name, verdict in stable.items():
        if verdict.verdict != "certified":
            raise SimError(f"{file}: {name} is {verdict.verdict}, so no device is armed with it; {verdict.reason}")
    return found


def check_meaning(options: RunHardware) -> None:
    """Refuse given options that have no effect on this device, by name.

    Raises
    ------
    ParameterError
        If there is one.
    """
    given = given_options(options.options)
    figure = ("figure", *meaningless_options("kinematic", given.get("mode") == "lead"))
    reasons = dict.fromkeys(("user", "person"), "whoever holds the stylus is the hand; leave it out")
    reasons |= dict.fromkeys(figure, "its figure is the animation, shown beside it by --view; leave it out")
    for name in reasons:
        if name in given:
            option = f"--{name.replace('_', '-')} {given[name]}"
            raise ParameterError(f"{option} has no meaning on a device: {reasons[name]}")
    check_emulate(options.name, options.emulate)
    if options.name == EMULATED and options.certificate is None and options.delay > 0.0:
        raise ParameterError(
            f"--delay {options.delay:g} has no meaning without --certificate: it is the delay that was certified; the "
            "emulated device's own is in its device file"
        )


def ignored_options(config: RunConfig) -> list[str]:
    """Options of a configuration that have no effect on a device: those of its simulated hand and of its figure."""
    user, figure = config.user, config.figure
    idle = ["user"] if user.does not in ("relaxed", "lead") else []
    idle += [name for name in ("person", "pushes", "turns", "grabs") if getattr(user, name)]
    idle += ["figure"] if figure.kind != "physical" else []
    numbers = meaningless_options("kinematic", config.leads)
    idle += [name for name in numbers if getattr(figure, name) != FIGURE_DEFAULTS[name]]
    return [f"--{name.replace('_', '-')}" for name in idle]


def check_limits(options: RunHardware) -> None:
    """Refuse limits that would not protect a hand on a real device.

    Raises
    ------
    SimError
        If an option is beyond its bound; the message names both.
    """
    for name, limit, unit in (
        ("force", 8.5, "N, the Premium's peak"), ("speed", 2.0, "m/s"), ("small", 2.0, "N"),
        ("silence", 5.0, "periods"),
    ):  # fmt: skip
        value = getattr(options, name)
        if value > limit:
            raise SimError(
                f"--{name} {value:g} is too much for a hand on a real device; expected at most {limit:g} {unit}"
            )
    if options.ramp < FORCE_RAMP_TIME:
        raise SimError(
            f"--ramp {options.ramp:g} is too quick for a hand on a real device; expected {FORCE_RAMP_TIME:g} s or "
            "more, a reaction"
        )


def check_device(identity: DeviceIdentity, calibration: Calibration | None, identified: bool = False) -> list[str]:
    """Check whether a device may be armed, given its calibration; returns warnings for the operator.

    `identified` says whether the device file has friction and inertia of this device.

    Raises
    ------
    SimError
        If it has no motors, is not calibrated, or the calibration is of another device.
    """
    if not identity.forces:
        raise SimError(f"{identity.name} has no motors and gives no force: it can be played, not armed")
    if calibration is None and not identity.calibrated:
        raise SimError(
            f"{identity.name} is not calibrated: its encoders have no zero; expected a --device-file that "
            "hvf hardware calibrate has written"
        )
    if calibration is not None and (reason := calibration.rejection_reason(identity)):
        raise SimError(
            f"the device file {reason}, this is {identity.name} {identity.serial}".rstrip()
            + "; calibrate it with hvf hardware calibrate"
        )
    warnings: list[str] = []
    if not identity.watchdog:
        warnings.append(
            f"{identity.name} has no watchdog: if this machine stops, its motors keep their last torque; "
            "keep its power switch within reach"
        )
    if identity.own_weight and not identified:
        warnings.append(
            f"{identity.name} is not a Phantom, and the certificate assumes a Phantom's friction and inertia; identify "
            "its own with hvf hardware identify, and certify with that --device-file; hold it firmly until then"
        )
    return warnings
