"""Runs a field on a device, from the configuration to a folder: permit, processes, operator, outcome."""

import contextlib
import multiprocessing
import socket
import sys
from collections.abc import Callable, Generator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

from controllers.safety.gate import Gate
from experiments.config.part import to_dict, to_json
from experiments.config.run_config import RunConfig
from experiments.console.compiling import compiler
from experiments.console.output import say
from experiments.files.device_files import (
    Calibration,
    calibration_from,
    content_of,
    linkage_from,
    read_device_file,
    save_device,
)
from experiments.files.json_text import json_text
from experiments.hardware.arming_checks import check_device, check_limits, check_meaning, ignored_options, verified
from experiments.hardware.operator_terminal import attend
from experiments.hardware.outcome import Outcome, holds_ticks, outcome_of
from experiments.hardware.page import page_session, show_status
from experiments.hardware.parts import MakeEmulated, MakeServo, served, session_of, start_of
from experiments.hardware.run_options import EMULATED, RunHardware
from experiments.results import folder as results
from experiments.setups.parts.defaults import resolved
from experiments.setups.session import Session
from geometry.whole_files import write_text
from models.world.scene import SceneConfig
from sim.devices.hardware_list import check_present
from sim.errors import SimError
from sim.hardware.controls import HardwareRun
from sim.hardware.emulated import delay_in_steps, emulated_identity
from sim.hardware.emulated_process import SHOWN_SIZE, EmulatedEnd, host_device
from sim.hardware.process_start import start_without_sigint
from sim.hardware.recorder_process import RecordingJob
from sim.hardware.servo_process import ServoClock
from sim.hardware.shared import SharedNumbers
from sim.recording.recording import Recording
from sim.world.linkage import Linkage

_NEW_RECORDING = f"{results.RECORDING}.new"  # name of the recording until the device is accepted


def run_hardware(config: RunConfig, options: RunHardware) -> int:
    """Run a field on a device, and write the results into a folder.

    Parameters
    ----------
    config : RunConfig
        Configuration of the field; its `seconds` is the time from the first arming to the end.
    options : RunHardware
        Device, certificate, limits.

    Returns
    -------
    int
        Exit code: 1 if a fault or a failure ended the run.

    Raises
    ------
    HvfError
        If there is no such device, an option has no meaning on it, it may not be armed with this field, or another run
        is being written into the folder. The folder is then left unchanged.
    """
    console = Console(stderr=True)
    check_meaning(options)
    results.check_folder(options.out, options.overwrite)
    if not (options.arm or sys.stdin.isatty()):
        raise SimError("nobody is at a terminal to arm the device; expected --arm, or a terminal")
    if ignored := ignored_options(config):
        console.print(f"Ignored on a device: {', '.join(ignored)}.", highlight=False)
    given, config = config, resolved(config)
    _check_permit(config, options, console)
    content, clock = content_of(config.device), config.clock
    known, calibration = linkage_from(content), calibration_from(content)
    scene = SceneConfig(servo_period=clock.servo_period, physics_step=clock.physics_step)
    emulation = _emulation(options, known, calibration, scene) if options.name == EMULATED else None
    session = _compile_session(given, options, console)  # which remarks on what was left open
    job = RecordingJob(options.out / _NEW_RECORDING, to_dict(config), session.static(), config.seed, scene, known)
    gate = Gate(
        clock.servo_period, force=options.force, speed=options.speed, speed_margin=0.5 * options.speed,
        small=options.small, ramp=options.ramp, dead_man=options.dead_man, permitted=True,
    )  # fmt: skip
    make = MakeServo(served(config), options.name, gate, known.offset, calibration, silent=options.silence)
    with run_folder(options) as begin, contextlib.ExitStack() as stack:
        if emulation is not None:
            make_device = MakeEmulated(scene, start_of(session), emulation.linkage)
            packets = stack.enter_context(emulated(make_device, options.realtime))
            make = replace(make, packets=packets, calibrated=emulation.calibrated)
        pace = ServoClock(late=options.late, realtime=options.realtime)
        run = stack.enter_context(HardwareRun(make, clock.servo_period, pace, job))
        ready = run.start()
        warnings = check_device(ready.identity, make.calibration, "inertia" in content)
        begin()
        # Only once the servo ticks, since a program that is killed earlier would leave them behind.
        write_text(options.out / results.CONFIG, to_json(config))
        if content:
            save_device(content, options.out / results.DEVICE)
        for line in (*warnings, *ready.said):
            console.print(line, highlight=False)
        if options.view:
            stack.enter_context(_serve_page(config, run))
        last = attend(run, config.seconds, options, console)
        ended = run.stop()
        outcome = outcome_of(options.out / results.RECORDING, ready, ended, last)
        summary = _write_results(outcome, session.remarks, options.out, console)
    say(summary, options.json)  # once all is written, for nobody may read it to the end
    return 0 if outcome.sound else 1


class _Emulation(NamedTuple):
    """Linkage of the emulated device, and whether its encoders have a zero."""

    linkage: Linkage
    calibrated: bool


def _emulation(options: RunHardware, known: Linkage, calibration: Calibration | None, scene: SceneConfig) -> _Emulation:
    """The device to emulate: that of `--emulate`, or else the one that the device file describes (`known`).

    Raises
    ------
    SimError
        If it cannot be emulated, or may not be armed with this calibration.
    """
    linkage = linkage_from(read_device_file(options.emulate)) if options.emulate else known
    calibrated = options.emulate is None or not any(linkage.offset)
    delay_in_steps(scene, linkage.delay)
    check_device(emulated_identity("MuJoCo", calibrated), calibration)
    return _Emulation(linkage, calibrated)


def _compile_session(config: RunConfig, options: RunHardware, console: Console) -> Session:
    """The session of the servo; compiles all units that servo and page need before their processes start."""
    session = session_of(served(config), ready=compiler(console))
    if options.view:
        page_session(config, ready=compiler(console))
    for remark in session.remarks:
        console.print(remark, highlight=False)
    return session


@contextlib.contextmanager
def run_folder(options: RunHardware) -> Generator[Callable[[], None], None, None]:
    """Lock the folder; the yielded function replaces an earlier run in it by the recording that has been begun.

    Until then the earlier run stays; if no tick is recorded, all that the run wrote is removed.
    """
    out, is_new, begun = options.out, not options.out.exists(), False

    def begin() -> None:
        nonlocal begun
        results.clear_folder(out)
        begun = True
        with contextlib.suppress(FileNotFoundError):  # the recorder could not start
            (out / _NEW_RECORDING).rename(out / results.RECORDING)

    with results.locked_folder(out):
        results.check_holds(out, options.overwrite)
        (out / _NEW_RECORDING).unlink(missing_ok=True)
        try:
            yield begin
        finally:
            (out / _NEW_RECORDING).unlink(missing_ok=True)
            if begun and not holds_ticks(out / results.RECORDING):
                for name in (results.CONFIG, results.DEVICE, results.RECORDING):
                    (out / name).unlink(missing_ok=True)
            with contextlib.suppress(OSError):  # other files are in it
                if is_new:
                    out.rmdir()


def _check_permit(config: RunConfig, options: RunHardware, console: Console) -> None:
    """Refuse a real device without a certificate of this field, and limits that would not protect a hand.

    Raises
    ------
    CertificateError, SimError
        If the device or its certificate is missing, or the device may not be armed.
    """
    if options.name != EMULATED:
        check_limits(options)
        check_present(options.name)
    if options.certificate is not None:
        found = verified(options.certificate, config, options.delay)
        console.print(f"Certified: {found.verdicts['stability'].reason}", highlight=False)
    elif options.name != EMULATED:
        raise SimError(
            f"{options.name} is armed with a certificate of this field only; expected --certificate, a folder that "
            "hvf certify has written with the same options"
        )


@contextlib.contextmanager
def emulated(make: MakeEmulated, realtime: bool) -> Generator[socket.socket, None, None]:
    """Run the emulated device in its own process; yields the servo's end of the socket."""
    servo_end, device_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    shown = SharedNumbers(SHOWN_SIZE)
    end = EmulatedEnd(device_end, shown, make.scene.servo_period)
    context = multiprocessing.get_context("spawn")
    process = context.Process(target=host_device, args=(make, end, realtime), name="device", daemon=True)
    start_without_sigint(process)
    device_end.close()
    try:
        yield servo_end
    finally:
        servo_end.close()
        process.kill()
        process.join()
        shown.close()


@contextlib.contextmanager
def _serve_page(config: RunConfig, run: HardwareRun) -> Generator[None, None, None]:
    context = multiprocessing.get_context("spawn")
    page = context.Process(target=show_status, args=(config, run.status, run.recorder_status), name="page", daemon=True)
    start_without_sigint(page)
    try:
        yield
    finally:
        page.kill()
        page.join()


def _write_results(outcome: Outcome, remarks: tuple[str, ...], out: Path, console: Console) -> dict[str, object]:
    """Write summary and page beside the recording; returns the summary."""
    summary = outcome.to_json() | {"remarks": remarks, "lines": outcome.lines()}
    if not holds_ticks(out / results.RECORDING):
        console.print(f"Nothing was recorded, so nothing is left in {out}.", highlight=False)
        return summary
    write_text(out / results.SUMMARY, json_text(summary) + "\n")
    written = [results.SUMMARY, results.RECORDING]
    if outcome.recorded:
        # Imported late, as it loads matplotlib.
        from experiments.results.pages.hardware_report import write_hardware_report

        with Recording(out / results.RECORDING) as recording:
            write_hardware_report(out, recording, [*remarks, *outcome.lines()])
        written.insert(0, results.REPORT)
    console.print(f"Written to {out}: {', '.join(written)}.", highlight=False)
    return summary
