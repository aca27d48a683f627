"""Films: of every kind of run, written completely or not at all, with bodies drawn above the floor."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from experiments.files.json_text import json_text
from experiments.render.film import Film, Frames, Show, render
from experiments.render.film_file import FilmFile, check_target
from experiments.render.graphics import NoGraphics, offscreen_backend
from experiments.render.scenes import lowest_point, seen_geoms
from experiments.render.shown_world import GHOST
from experiments.render.timeline import Ghost
from models.humanoid.skeleton import N_POSE, rest_pose
from models.mocap.motion.clip import Clip
from models.mocap.readers.own_bvh import write_bvh
from models.world.scene import P_WH
from sim.errors import SimError
from sim.recording.recorder import Group, Recorder
from sim.recording.recording import Recording
from sim.world.world import World
from tests.experiments.own_process import stderr_of_interrupted

Colours = npt.NDArray[np.int64]

SMALL = Film(width=160, height=120, fps=10.0)
SECONDS, RATE, FRAME_RATE = 1.0, 1000.0, 125.0


@pytest.fixture(scope="module")
def backend() -> str:
    try:
        return offscreen_backend()
    except NoGraphics as error:
        pytest.skip(str(error))


@dataclass
class RunSpec:
    """A synthetic run of one second: depth of its figure below the floor, distance travelled, force."""

    kind: str = "physical"
    depth: float = 0.0
    travel: float = 0.0
    force: float = 0.7
    complete: bool = True


def write_run(folder: Path, spec: RunSpec) -> Path:
    """A recording in which the figure stands, or goes along x, and the stylus is pushed."""
    world = World(kind=spec.kind)
    world.reset(np.zeros(3), rest_pose())
    n, m = round(SECONDS * RATE), round(SECONDS * FRAME_RATE)
    poses = np.tile(rest_pose(), (m, 1))
    poses[:, 0] = spec.travel * np.linspace(0.0, 1.0, m)
    poses[:, 2] -= spec.depth
    qpos = np.tile(world.data.qpos, (m, 1))
    if spec.kind == "kinematic":
        qpos = np.hstack((qpos, poses))
    elif spec.kind == "physical":
        qpos[:, world.pose_at : world.pose_at + N_POSE] = poses
    angle = np.linspace(0.0, 2.0 * np.pi, 241)
    static = {
        "curve": 0.05 * np.column_stack((np.cos(angle) - 1.0, np.sin(angle), 0.0 * angle)), "tube_radius": 0.02,
        "p_WH": P_WH, "scene": np.array([1.75, 75.0, 1e-3, 1.25e-4]), "figure": spec.kind,
    }  # fmt: skip
    frames: dict[str, tuple[int, ...]] = {"t": (), "qpos": (qpos.shape[1],)}
    rows = {"t": np.arange(m) / FRAME_RATE, "qpos": qpos}
    if spec.kind != "none":
        frames["reference"], rows["reference"] = (N_POSE,), poses
    ticks = {
        "t": np.arange(n) / RATE,
        "p": np.zeros((n, 3)),
        "force": np.tile(spec.force * np.array([0.6, -0.8, 0.0]), (n, 1)),
        "user": np.zeros((n, 3)),
    }
    shapes = {"t": (), "p": (3,), "force": (3,), "user": (3,)}
    folder.mkdir()
    groups = {"ticks": Group(RATE, shapes), "frames": Group(FRAME_RATE, frames)}
    with Recorder(folder / "run.h5", {}, 1, groups, static) as recorder:
        recorder.append("ticks", ticks)
        recorder.append("frames", rows)
        if spec.complete:
            recorder.close({"lines": []})
            write_bvh(Clip(poses[::5], FRAME_RATE / 5, "default"), folder / "default.bvh")
    return folder


@pytest.mark.parametrize(
    "kind", [*(pytest.param(kind, marks=pytest.mark.slow) for kind in ("physical", "kinematic")), "none"]
)
def test_every_figure_kind_is_rendered_to_playable_films(kind: str, tmp_path: Path, backend: str) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    run, target = write_run(tmp_path / "run", RunSpec(kind)), tmp_path / "film.mp4"
    render(run, target, SMALL, gif=True)
    frames, seconds = ffmpeg.count_frames_and_secs(str(target))
    assert (frames, seconds) == (10, pytest.approx(1.0, abs=0.11))
    assert ffmpeg.count_frames_and_secs(str(target.with_suffix(".gif")))[0] == 5
    assert sorted(path.name for path in tmp_path.iterdir()) == ["film.gif", "film.mp4", "run"]


@pytest.mark.parametrize("kind", ["physical", "kinematic"])
def test_figures_are_drawn_above_the_floor_and_their_depth_is_reported(kind: str, tmp_path: Path, backend: str) -> None:
    run = write_run(tmp_path / "run", RunSpec(kind, depth=0.03))
    with Recording(run / "run.h5") as recording:
        frames = Frames(recording, run, SMALL, backend)
        frames.frame(5)
        world = frames.stage.world
        for prefix in (world.prefix, GHOST):
            assert lowest_point(world.model, world.data, seen_geoms(world.model, prefix)) >= -1e-9
            assert frames.stage.clearance[prefix].lowest == pytest.approx(-0.03, abs=1e-3)
        frames.close()


def test_travelling_figure_stays_in_the_picture(tmp_path: Path, backend: str) -> None:
    run = write_run(tmp_path / "run", RunSpec(travel=8.0))
    with Recording(run / "run.h5") as recording:
        frames = Frames(recording, run, Film(show="stage", ghost="none", width=160, height=120, fps=10.0), backend)
        for row in (0, 5, 9):
            picture = frames.frame(row)
            # Trousers and shoes are the only dark things on the floor.
            columns = np.nonzero(picture[30:100].max(axis=2) < 70)[1]
            assert len(columns) > 20
            assert 30 < columns.mean() < 130
        frames.close()


def rendered(run: Path, show: Show, ghost: Ghost, backend: str) -> Colours:
    """A frame without its caption, as integers."""
    with Recording(run / "run.h5") as recording:
        frames = Frames(recording, run, Film(show=show, ghost=ghost, width=320, height=240, fps=10.0), backend)
        picture = frames.frame(3)[60:].astype(np.int64)
        frames.close()
    return picture


@pytest.mark.slow
def test_ghost_and_force_arrow_are_drawn_only_if_present(tmp_path: Path, backend: str) -> None:
    run, rest = write_run(tmp_path / "run", RunSpec()), write_run(tmp_path / "rest", RunSpec(force=0.0))
    for ghost, least, most in (("default", 300, np.inf), ("none", 0, 10)):
        red, _, blue = np.moveaxis(rendered(run, "stage", ghost, backend), 2, 0)
        assert least <= np.count_nonzero((blue > red + 40) & (red > 90)) <= most, ghost
    difference = rendered(run, "workspace", "none", backend) - rendered(rest, "workspace", "none", backend)
    changed = np.abs(difference).max(axis=2) > 20
    assert 30 < np.count_nonzero(changed) < 3000
    assert np.count_nonzero(changed & (difference[..., 1] > difference[..., 0])) > 0.8 * np.count_nonzero(
        changed
    )  # green


@pytest.mark.slow
def test_film_of_incomplete_run_is_reported_and_shows_the_edited_animation(
    tmp_path: Path, backend: str, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("imageio_ffmpeg")
    run = write_run(tmp_path / "run", RunSpec(complete=False))
    filmed = render(run, tmp_path / "film.mp4", SMALL)
    assert "cut short" in capsys.readouterr().err
    assert any("lowest point of the figure" in line for line in filmed.lines())
    assert json.loads(json_text(filmed))["clearance"]["figure"]["lowest"] == filmed.clearance["figure"].lowest
    with Recording(run / "run.h5") as recording:
        frames = Frames(recording, run, SMALL, backend)
        assert frames.moments.kind == "animation"
        frames.close()


def test_existing_film_or_unknown_format_is_refused(tmp_path: Path) -> None:
    film = tmp_path / "film.mp4"
    film.write_bytes(b"mine")
    with pytest.raises(SimError, match="--overwrite"):
        check_target(film, overwrite=False)
    check_target(film, overwrite=True)
    with pytest.raises(SimError, match=r"\.mp4 or \.gif"):
        check_target(tmp_path / "film.avi", overwrite=False)


@pytest.mark.parametrize("wrong", [{"width": 161}, {"height": 20}, {"fps": 0.0}, {"seconds": 0.0}])
def test_invalid_film_sizes_and_rates_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(SimError, match="expected"):
        Film(**wrong)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("frames", [0, 1])
def test_interrupted_film_keeps_the_old_file(frames: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("imageio_ffmpeg")
    film = tmp_path / "film.mp4"
    film.write_bytes(b"the old one")

    def stopped() -> None:
        with FilmFile(film, 160, 120, 10.0) as file:
            for _ in range(frames):
                file.add(np.zeros((120, 160, 3), dtype=np.uint8))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert film.read_bytes() == b"the old one"
    assert [path.name for path in tmp_path.iterdir()] == ["film.mp4"]
    assert capfd.readouterr() == ("", "")  # no output of ffmpeg


@pytest.mark.slow
def test_ctrl_c_on_render_leaves_no_file(tmp_path: Path, backend: str) -> None:
    pytest.importorskip("imageio_ffmpeg")
    run, film = write_run(tmp_path / "run", RunSpec()), tmp_path / "films" / "film.mp4"
    words = ["render", str(run), "--out", str(film), "--fps", "200"]
    stderr = stderr_of_interrupted(words, lambda: bool(list(film.parent.glob(".*.mp4"))), wait=0.0)
    assert "Traceback" not in stderr
    assert not list(film.parent.iterdir())


def test_missing_graphics_backend_is_reported_with_packages_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("experiments.render.graphics.OFFSCREEN", ("nothing_of_that_name",))
    with pytest.raises(NoGraphics, match=r"^[^\n]*libegl1[^\n]*libosmesa6[^\n]*$"):
        offscreen_backend()
