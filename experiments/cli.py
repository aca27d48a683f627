"""The ``hvf`` command: haptic vector fields from the command line."""

import os
import time

_STARTED = time.perf_counter()
# The matrices here are small: more threads only get into each other's way. Read by NumPy when it is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import contextlib  # noqa: E402
import io  # noqa: E402
import itertools  # noqa: E402
import re  # noqa: E402
import sys  # noqa: E402
from collections.abc import Sequence  # noqa: E402
from dataclasses import dataclass, field  # noqa: E402
from importlib.metadata import version  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import Annotated  # noqa: E402

import tyro  # noqa: E402

from controllers.certificates.flight.tolerance import BallisticTolerance, Judging  # noqa: E402
from controllers.certificates.loop.hand import NO_HANDS, HandRange  # noqa: E402
from controllers.certificates.report import Certificate, ChangedInputs  # noqa: E402
from controllers.errors import ControllerError, ParameterError  # noqa: E402
from controllers.haptic_map.lifting.room import Room  # noqa: E402
from experiments.config.part import above, at_least, part, whole  # noqa: E402
from experiments.config.run_config import ArmConfig, RunConfig  # noqa: E402
from experiments.config.words import RunOptions, config_of_options  # noqa: E402
from experiments.files.json_text import json_text  # noqa: E402
from experiments.hardware.command import Hardware  # noqa: E402
from experiments.live.live_options import Live  # noqa: E402
from experiments.paper_figures.options import Figures  # noqa: E402
from experiments.preparation.prepare_options import Prepare  # noqa: E402
from experiments.render.options import Render  # noqa: E402
from experiments.results.folder import RECORDING  # noqa: E402
from experiments.trials.command import Trials  # noqa: E402
from experiments.tuning.command import Tune  # noqa: E402
from experiments.welcome import WELCOME, next_step  # noqa: E402
from experiments.working import working  # noqa: E402
from models.errors import ModelError  # noqa: E402
from models.mocap.clip import Clip  # noqa: E402
from sim.errors import SimError  # noqa: E402

Positional = tyro.conf.Positional


@dataclass(frozen=True)
class Run:
    """Run a hand, a field, a map and a figure, and write what happened into a folder."""

    options: tyro.conf.OmitArgPrefixes[RunOptions]  # pyright: ignore[reportInvalidTypeForm] - made of the parts
    out: Path = Path("runs/run")
    """Folder to write."""
    overwrite: bool = False
    """Replace the run that the folder holds."""
    view: bool = False
    """Show the run in a browser while it goes on."""

    def __call__(self) -> int:
        """Run."""
        from experiments.run import run

        run(config_of_options(self.options), self.out, self.overwrite, _STARTED, self.view)
        return 0


@dataclass(frozen=True)
class Demo:
    """The four-clip cylinder of the paper's Fig. 3: two relaxed laps, then one with pushes outwards and inwards."""

    out: Path = Path("runs/demo")
    """Folder to write."""
    overwrite: bool = False
    """Replace the run that the folder holds."""

    def __call__(self) -> int:
        """Run."""
        from experiments.demo import demo_config
        from experiments.run import run

        run(demo_config(), self.out, self.overwrite, _STARTED)
        return 0


@dataclass(frozen=True)
class Convert:
    """Convert a BVH, AMC or DeepMimic motion to the figure's own BVH, or to glTF."""

    source: Positional[Path]
    """Motion file to read."""
    target: Positional[Path]
    """File to write: .bvh, or .glb for glTF."""
    overwrite: bool = False
    """Replace the target if it exists."""

    def __call__(self) -> int:
        """Convert, and say what the file was taken for."""
        if self.target.suffix.lower() == ".glb":
            from experiments.export.gltf import convert_to_gltf as convert
        else:
            from models.mocap.library import convert

        report = convert(self.source, self.target, overwrite=self.overwrite).report
        for line in report.lines() if report else ("the figure's own skeleton: nothing to retarget",):
            print(line)
        return 0


@part
class Track:
    """Let the physical figure follow clips on its own, and report how well it does."""

    clips: Positional[tuple[str, ...]] = ()
    """Names of embedded clips, or files; all embedded clips by default."""
    seconds: Annotated[float, above(0.0, unit="s")] = 10.0
    """Simulated time for each [s]."""
    json: bool = False
    """Print the reports as JSON."""

    def __call__(self) -> int:
        """Track."""
        from experiments.track import track_clips

        track_clips(self.clips, self.seconds, self.json)
        return 0


@part
class Certify:
    """Say what is certain of a field, a run, a map or the flights of a clip: certified, refuted or unknown."""

    options: tyro.conf.OmitArgPrefixes[RunOptions]  # pyright: ignore[reportInvalidTypeForm] - made of the parts
    run: Annotated[Path | None, tyro.conf.Positional] = None
    """Folder of a run, whose field and clips are certified; flags of the run itself then do not count."""
    clip: str | None = None
    """Judge this motion instead of a field: a file, or the name of an embedded clip."""
    out: Path | None = None
    """Folder for the certificate, runs/certificate by default, runs/certificate-CLIP of a clip; one that is there
    already is taken if nothing has changed."""
    delay: Annotated[float, at_least(0.0, unit="s")] = 0.0
    """Of the motors' torques, for a field [s]."""
    hand_push: Annotated[float, at_least(0.0, unit="N")] = 1.0
    """Largest force of the hand for which the distance from the curve is bounded [N]."""
    hand: HandRange = field(default_factory=HandRange)
    no_hand: bool = False
    """Certify for nobody's hand on the stylus."""
    tolerance: BallisticTolerance = field(default_factory=BallisticTolerance)
    friction: Annotated[float, above(0.0)] = Judging.friction
    """Coefficient of friction of soles on the floor, for clips."""
    verify: Path | None = None
    """Only check that this certificate.json is of the same field, hands, clips and code; exit code 1 if it is not."""
    json: bool = False
    """Print the certificate as JSON."""

    def __call__(self) -> int:
        """Certify, or verify."""
        certificate = self._checked(self.verify) if self.verify is not None else self._made()
        if certificate is None:
            return 1
        if self.json:
            print(json_text(certificate.to_json()))
            return 0
        if self.verify is not None:
            print(f"{self.verify}: all that it is of is as it was")
        for name, verdict in certificate.verdicts.items():
            print(f"{name}: {verdict.verdict}; {verdict.reason}")
        return 0

    def _hands(self) -> HandRange:
        return NO_HANDS if self.no_hand else self.hand

    def _judging(self) -> Judging:
        return Judging(self.tolerance, self.friction)

    def _what(self) -> tuple[RunConfig, tuple[Clip, ...]]:
        """The field, and the clips that are certified with it; gains alone have none."""
        config = config_of_options(self.options)
        if self.run is None and config.map.kind not in ("led", "file"):
            return config, ()
        from experiments.certify.certified_clips import run_and_clips

        return run_and_clips(self.run, config)

    def _made(self) -> Certificate:
        from experiments.certify.certify import certify_clip_into, certify_into

        if self.clip is not None:
            folder = self.out or Path(f"runs/certificate-{Path(self.clip).stem}")
            with working("certifying a clip"):
                return certify_clip_into(self.clip, folder, self._judging())
        config, clips = self._what()
        folder = self.out or Path("runs/certificate")
        with working("certifying"):
            return certify_into(config, folder, self.delay, self._hands(), self.hand_push, clips, self._judging())

    def _checked(self, file: Path) -> Certificate | None:
        from experiments.certify.certified_field import certificate_inputs
        from experiments.files.certificate_files import clip_inputs, verify_certificate

        if self.clip is not None:
            from experiments.setups.clips import load_clips

            inputs = clip_inputs(load_clips([self.clip])[0][0], self._judging())
        else:
            config, clips = self._what()
            inputs = certificate_inputs(config, self.delay, self._hands(), self.hand_push, clips, self._judging())
        try:
            return verify_certificate(file, inputs)
        except ChangedInputs as error:
            print(f"hvf: {error}", file=sys.stderr)
            return None


@dataclass(frozen=True)
class Repair:
    """Write the nearest motion whose flights can be flown."""

    source: Positional[Path]
    """Motion file to read."""
    target: Positional[Path]
    """BVH file to write."""
    overwrite: bool = False
    """Replace the target if it exists."""

    def __call__(self) -> int:
        """Repair, and say what was changed."""
        from experiments.flights.repair import repair_file

        with working("repairing"):
            repaired = repair_file(self.source, self.target, self.overwrite)
        for line in repaired.lines():
            print(line)
        return 0


@dataclass(frozen=True)
class TeleArm:
    """Let the field lead a robot arm of seven joints instead of the figure, and write what happened into a folder."""

    config: tyro.conf.OmitArgPrefixes[ArmConfig] = field(default_factory=ArmConfig)
    out: Path = Path("runs/arm")
    """Folder to write."""
    overwrite: bool = False
    """Replace the run that the folder holds."""

    def __call__(self) -> int:
        """Run."""
        from experiments.run_arm import run_arm

        run_arm(self.config, self.out, self.overwrite)
        return 0


@part
class Lift:
    """Author a curve for every clip, and one haptic map with all of them, from the clips alone."""

    clips: Positional[tuple[str, ...]]
    """Names of embedded clips, or files."""
    out: Path = Path("runs/map.npz")
    """File to write the map into."""
    room: Room = field(default_factory=Room)
    cyclic: tuple[str, ...] = ()
    """Clips that have to close; by default all those are closed curves that do."""
    seed: Annotated[int, whole(0)] = 1
    """Of the places from which the arrangement begins."""
    overwrite: bool = False
    """Replace the file if it exists."""
    json: bool = False
    """Print the report as JSON."""

    def __call__(self) -> int:
        """Lift, and say what came of it."""
        from experiments.lifting.lift import lift_into

        with working("lifting", len(self.clips)):
            report = lift_into(self.clips, self.out, self.room, self.cyclic, self.seed, self.overwrite)
        print(json_text(report.to_json()) if self.json else "\n".join(report.lines()))
        return 0


@dataclass(frozen=True)
class Report:
    """Draw the figures and the page of a run again, from its recording."""

    folder: Positional[Path]
    """Folder of a run."""

    def __call__(self) -> int:
        """Draw."""
        from experiments.results.report_of import write_report_of

        with working("drawing the report"):
            write_report_of(self.folder)
        print(f"Written: {self.folder / 'report.html'}; open it in a browser.")
        return 0


@dataclass(frozen=True)
class Picture:
    """Render the Phantom and the figure of a run into a PNG file."""

    folder: Positional[Path]
    """Folder of a run."""
    target: Positional[Path]
    """PNG file to write."""

    def __call__(self) -> int:
        """Render."""
        from experiments.render.picture import draw_picture

        with working("drawing"):
            draw_picture(self.folder, self.target)
        return 0


@dataclass(frozen=True)
class Reproduce:
    """Run a recording's configuration again and compare, bit for bit."""

    folder: Positional[Path]
    """Folder of a run."""

    def __call__(self) -> int:
        """Exit code 0 if every tick is the same, 1 if not."""
        from experiments.reproduce import reproduce

        return reproduce(self.folder)


@dataclass(frozen=True)
class Bench:
    """Measure speed, as ratios within one run."""

    def __call__(self) -> int:
        """Measure."""
        from experiments.studies.benchmarks import bench

        with working("measuring speed"):
            bench()
        return 0


@part
class Users:
    """Hold simulated people against the published laws of human movement: a table, and a figure each."""

    out: Path = Path("runs/users")
    """Folder to write."""
    people: Annotated[int, whole(1)] = 3
    """How many people of a population take part."""
    seed: Annotated[int, whole(0)] = 8
    """Of the population and of its noise."""
    laws: tuple[str, ...] = ()
    """fitts, scatter, steering, power-law, tremor, step-response, grip; all by default."""
    overwrite: bool = False
    """Replace the table that the folder holds."""
    json: bool = False
    """Print the table as JSON."""

    def __call__(self) -> int:
        """Exit code 0 if every law holds, 1 if one does not."""
        from experiments.studies.user_laws.report import TABLE, laws_into, lines

        laws = laws_into(self.out, self.people, self.seed, self.laws, self.overwrite)
        print((self.out / TABLE).read_text(encoding="utf-8").rstrip() if self.json else "\n".join(lines(laws)))
        return 0 if all(law.holds for law in laws) else 1


@dataclass(frozen=True)
class Clips:
    """Name the embedded clips."""

    json: bool = False
    """Print them as JSON."""

    def __call__(self) -> int:
        """Name them."""
        from models.mocap.library import embedded, embedded_names

        found = [embedded(name) for name in embedded_names()]
        if self.json:
            print(
                json_text([{"name": c.name, "seconds": c.duration, "closed": c.closes(), "fps": c.fps} for c in found])
            )
            return 0
        for clip in found:
            print(f"{clip.name:14} {clip.duration:5.2f} s  {'closed' if clip.closes() else 'open'}")
        return 0


Command = (
    Annotated[Demo, tyro.conf.subcommand("demo")]
    | Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Live, tyro.conf.subcommand("live")]
    | Annotated[Clips, tyro.conf.subcommand("clips")]
    | Annotated[Convert, tyro.conf.subcommand("convert")]
    | Annotated[Prepare, tyro.conf.subcommand("prepare")]
    | Annotated[Track, tyro.conf.subcommand("track")]
    | Annotated[Certify, tyro.conf.subcommand("certify")]
    | Annotated[Lift, tyro.conf.subcommand("lift")]
    | Annotated[Repair, tyro.conf.subcommand("repair")]
    | Annotated[TeleArm, tyro.conf.subcommand("arm")]
    | Annotated[Trials, tyro.conf.subcommand("trials")]
    | Annotated[Tune, tyro.conf.subcommand("tune")]
    | Annotated[Report, tyro.conf.subcommand("report")]
    | Annotated[Picture, tyro.conf.subcommand("picture")]
    | Annotated[Render, tyro.conf.subcommand("render")]
    | Annotated[Figures, tyro.conf.subcommand("figures")]
    | Annotated[Reproduce, tyro.conf.subcommand("reproduce")]
    | Annotated[Users, tyro.conf.subcommand("users")]
    | Annotated[Bench, tyro.conf.subcommand("bench")]
    | Annotated[Hardware, tyro.conf.subcommand("hardware")]
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; bad input is one line on stderr and exit code 2, a reader that has gone is 141."""
    try:
        try:
            return _run(arguments)
        finally:
            sys.stdout.flush()
    except BrokenPipeError:
        # As `head` leaves it: what is still to be written goes nowhere, also when the interpreter ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141


def _run(arguments: Sequence[str] | None) -> int:
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words in ([], ["--version"]):
        print(WELCOME if not words else f"hvf {version('haptic-vector-fields')}")
        return 0
    command: Command | None = None
    try:
        command = parsed(arguments)
        return command()
    except BrokenPipeError:
        raise
    except (ModelError, ControllerError, SimError) as error:
        print(f"hvf: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        said = f"{error.filename}: {error.strerror}; expected a path to read or write" if error.filename else error
        print(f"hvf: {said}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"hvf: stopped; {_kept(command)}", file=sys.stderr)
        return 130


def _kept(command: Command | None) -> str:
    """What is left of a command that was stopped, and how to go on."""
    if isinstance(command, Run | Demo) and (command.out / RECORDING).exists():
        return next_step(str(command.out))
    return "nothing is left half done"


def parsed(arguments: Sequence[str] | None) -> Command:
    """The command that was typed.

    Raises
    ------
    ParameterError
        If it was mistyped: what tyro says in a box, in one line.
    """
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return tyro.cli(Command, prog="hvf", args=arguments, description=__doc__)  # pyright: ignore[reportArgumentType, reportUnknownVariableType, reportCallIssue]
    except SystemExit as ended:
        if ended.code in (0, None):
            raise
        # A part that refuses a number says so itself.
        cause: BaseException | None = ended
        while cause is not None:
            if isinstance(cause, ParameterError):
                raise cause from None
            cause = cause.__cause__ or cause.__context__
        lines = [line.strip("│ ") for line in said.getvalue().splitlines() if line.startswith("│")]
        first = " ".join(itertools.takewhile(lambda line: set(line) != {"─"}, lines))
        raise ParameterError(re.sub(r"^Error parsing \w+: ", "", first) or said.getvalue().strip()) from None


if __name__ == "__main__":
    sys.exit(main())
