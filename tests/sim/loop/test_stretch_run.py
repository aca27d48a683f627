"""The servo with STRETCHY TUBES: a simulated hand bends the curve, and the figure shows the pose at the hand."""

import matplotlib.image
import numpy as np
import pytest

from controllers.curves.closest_point import closest_phases
from controllers.curves.trajectory import Trajectory
from controllers.errors import CurveError
from controllers.fields.stretchy_tubes import StretchyTubes
from controllers.state import stylus_path
from experiments.config.modes import Stretch
from experiments.config.options import run_config
from experiments.files.curve_files import CURVE_FILE, load_curve, save_curve
from experiments.results.measures.stretch_summary import stretch_summary
from experiments.results.pages.mode_figures import stretch_figure
from experiments.setups.modes.stretch import stretch_grabs, stretch_parts
from experiments.setups.session import Session
from experiments.setups.wiring import wire
from models.mocap.motion.clip import pose_difference
from sim.errors import SimError
from sim.loop.channels import groups
from sim.loop.loop import Loop
from sim.loop.servo import FrameLog, TickLog
from sim.recording.recorder import Recorder
from sim.recording.recording import Recording
from sim.reference.reference import map_poses
from sim.users.hand.arm import Arm

MODE = Stretch(seek=150.0, rubber=150.0, tube_damping=14.0, rubber_tube=0.008, bump=0.5)
SECONDS = 4.3  # the first grab, and a little more


def run_stretch() -> tuple[Session, StretchyTubes, dict[str, np.ndarray]]:
    config = run_config(clips=("cheer", "angry"), seconds=SECONDS)
    session = wire(config)
    grabs = stretch_grabs(session.curve, MODE.rubber_tube)[:1]
    bending = run_config(mode="stretch", seconds=SECONDS, grabs=grabs)  # pyright: ignore[reportArgumentType]
    field = stretch_parts(bending, MODE, session.parts.maps).field
    assert isinstance(field, StretchyTubes)
    program, channels = field.program(), {"p": [], "switch": [], "distance": [], "force": []}
    shown: list[np.ndarray] = []
    compiled = session.servo.field.of(program)
    servo = session.servo._replace(field=compiled, device=session.servo.device.held_by(Arm(grabs=grabs)))

    def append_block(ticks: TickLog, frames: FrameLog, n: int) -> None:
        for name, block in (("p", ticks.hand[:, 1:4]), ("switch", ticks.hand[:, 14]), ("distance", ticks.trace[:, 4])):
            channels[name].append(block[:n].copy())
        channels["force"].append(ticks.force[:n].copy())
        shown.append(frames.reference[: -(-n // servo.figure_ticks)].copy())

    Loop(servo, session.world, append_block).run(SECONDS)
    recorded = {name: np.concatenate(blocks) for name, blocks in channels.items()}
    return session, field, recorded | {"shown": np.concatenate(shown), "memory": servo.field.memory}


@pytest.fixture(scope="module")
def stretch_run() -> tuple[Session, StretchyTubes, dict[str, np.ndarray]]:
    return run_stretch()


def test_hand_bends_the_curve_and_the_held_point_is_at_the_stylus(stretch_run) -> None:
    _, field, recorded = stretch_run
    held = recorded["switch"] > 0.0
    period = SECONDS / len(held)
    assert np.sum(held) * period == pytest.approx(1.7, abs=0.01)
    assert recorded["distance"][held].max() < 1e-9
    summary = stretch_summary(field, recorded["memory"])
    assert summary.edits == 1
    assert 8.0 < summary.largest_mm < 20.0
    assert 0.2 < summary.changed < 0.3
    assert summary.held_off_m < 1e-9
    assert summary.line().startswith("The curve was bent once, by up to 1")
    last = np.flatnonzero(held)[-1]
    # The held point stays where it was released.
    _, distances = closest_phases(field.edited(recorded["memory"]).packed(), recorded["p"][last : last + 1])
    assert distances[0] < 1e-9


def test_rubber_pulls_the_hand_back(stretch_run) -> None:
    _, field, recorded = stretch_run
    last = np.flatnonzero(recorded["switch"] > 0.0)[-1]
    away = recorded["p"][last] - field.curve.point(0.5)
    np.testing.assert_allclose(recorded["force"][last], -MODE.rubber * away, atol=0.1)


def test_figure_shows_the_animation_at_the_held_point(stretch_run) -> None:
    session, _, recorded = stretch_run
    last = np.flatnonzero(recorded["switch"] > 0.0)[-1]
    # Along the path of the hand, since feet in stance keep their places while the mixture changes.
    held = map_poses(session.haptic_map, stylus_path(recorded["p"][: last + 1]))[-1]
    poses = held, map_poses(session.haptic_map, stylus_path(session.curve.point(0.5)[None]))[0]
    frame = int(last // session.servo.figure_ticks)
    under_held_point, before_bending = (
        np.abs(pose_difference(recorded["shown"][frame : frame + 1], pose[None])[0, 6:]) for pose in poses
    )
    # The hand has been at rest for 0.4 s, so the stylus filter has caught up.
    assert under_held_point.max() < np.radians(1.0)
    assert before_bending.max() > 3.0 * under_held_point.max()


def test_repeated_runs_bend_the_curve_identically(stretch_run) -> None:
    _, _, recorded = stretch_run
    np.testing.assert_array_equal(run_stretch()[2]["memory"], recorded["memory"])


def test_bent_curve_is_saved_loaded_and_drawn(stretch_run, tmp_path) -> None:
    session, field, recorded = stretch_run
    bent, path = field.edited(recorded["memory"]), tmp_path / CURVE_FILE
    save_curve(bent, path)
    loaded = load_curve(path)
    phases = np.linspace(0.0, 4.0, 501)
    np.testing.assert_allclose(loaded.point(phases), bent.point(phases), atol=1e-12)
    assert loaded.periodic
    servo = session.servo
    with Recorder(tmp_path / "run.h5", {}, 1, groups(servo, session.world), session.static()) as recorder:
        names = groups(servo, session.world)["ticks"].channels
        recorder.append("ticks", {name: recorded["p"] if name == "p" else np.zeros((len(recorded["p"]), *shape))
                                  for name, shape in names.items()})  # fmt: skip
    with Recording(tmp_path / "run.h5") as recording:
        stretch_figure(recording, loaded).savefig(tmp_path / "stretch.png", dpi=150)
    image = matplotlib.image.imread(tmp_path / "stretch.png")
    green = (image[..., 1] > image[..., 0] + 0.2) & (image[..., 1] > image[..., 2] + 0.2)
    assert green.sum() > 1000  # the bent curve, drawn twice


@pytest.mark.parametrize(
    "text",
    ["{", "[1]", '{"times": 1}', '{"times": [0], "positions": [], "quaternions": [], "periodic": 1}', "[" * 9999],
)
def test_file_without_a_curve_is_refused(text: str, tmp_path) -> None:
    path = tmp_path / CURVE_FILE
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SimError, match=r"curve\.json: not a curve"):
        load_curve(path)
    with pytest.raises(SimError, match="not a curve"):
        load_curve(tmp_path / "missing.json")


def test_curve_with_invalid_numbers_is_refused_with_them(tmp_path) -> None:
    path = tmp_path / CURVE_FILE
    save_curve(Trajectory([0.0, 1.0], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), path)
    path.write_text(path.read_text(encoding="utf-8").replace("[0.0, 1.0]", "[1.0, 1.0]"), encoding="utf-8")
    with pytest.raises(CurveError, match=r"curve\.json: times of a curve must increase"):
        load_curve(path)
