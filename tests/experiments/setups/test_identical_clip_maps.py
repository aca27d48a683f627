"""FOLLOW over copies of one clip on a map costs the physical figure little more than tracking the clip."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from controllers.haptic_map.cylindrical import Cylindrical
from experiments.cli import main
from experiments.config.options import run_config
from experiments.config.run_config import RunConfig
from experiments.fitting.motion_faults import motion_faults
from experiments.fitting.similarity import faults_at
from experiments.setups.wiring import wire
from experiments.trials.trial.measures import TrialLog
from models.mocap.library import embedded
from sim.body.tracking import TrackingConfig, track
from sim.loop.loop import Loop

SECONDS = 6.0
POINTS = 0.03  # [body weights] RMS that a map may add


def residual(config: RunConfig) -> float:
    """RMS of the residual force of a run [body weights]; a root off by 0.5 m is a fall."""
    session = wire(config)
    log = TrialLog(session.servo, session.world)
    Loop(session.servo, session.world, log).run(SECONDS)
    assert log.frames["root_error"].max() < 0.5
    force = np.linalg.norm(log.frames["residual"][:, :3], axis=1)[log.frames["flight"] == 0.0]
    return float(np.sqrt(np.mean(force**2))) / session.weight


@cache
def bound(name: str) -> float:
    return track(embedded(name), SECONDS, TrackingConfig()).stance.force_rms + POINTS


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "name"),
    [("cylindrical", "walk"), ("cylindrical", "run"), ("cylindrical", "jump"), ("composite", "walk"),
     ("composite", "run"), ("rivers", "walk"), ("rivers", "run"), ("rivers", "jump")],
)  # fmt: skip
def test_map_of_copies_adds_at_most_three_points_of_residual(kind: str, name: str) -> None:
    mode = "rivers" if kind == "rivers" else "follow"
    clips = (name,) * (4 if kind == "cylindrical" else 3)
    config = run_config(mode=mode, map=kind, clips=clips, lap=embedded(name).duration, seconds=SECONDS)
    assert residual(config) < bound(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["run", "jump"])
def test_lifted_map_of_copies_adds_at_most_three_points_of_residual(name: str, tmp_path: Path) -> None:
    file = tmp_path / "map.npz"
    assert main(["lift", *[name] * 4, "--out", str(file)]) == 0
    for mode in ("follow", "rivers"):
        assert residual(run_config(mode=mode, map=str(file), seconds=SECONDS)) < bound(name), mode


def test_lap_at_map_corner_has_the_residual_of_its_clip() -> None:
    clip = embedded("walk")
    haptic_map = wire(run_config(clips=("walk",) * 4, lap=clip.duration, seconds=1.0)).haptic_map
    assert isinstance(haptic_map, Cylindrical)
    corner, own = faults_at(haptic_map, (0.0, 0.0), clip.duration), motion_faults(clip.poses, clip.fps)
    assert corner.residual == pytest.approx(own.residual, abs=0.002)
    assert corner.skate == pytest.approx(own.skate, abs=0.005)


def test_authored_walk_feet_neither_sink_nor_skate() -> None:
    motion = motion_faults(embedded("walk").poses, embedded("walk").fps)
    assert motion.lowest > -0.005
    assert motion.skate < 0.01
    # A walk that is carried sideways skates as far as it is carried in a stance.
    carried = embedded("walk").poses.copy()
    carried[:, 1] += 0.1 * np.arange(len(carried)) / embedded("walk").fps
    assert 0.03 < motion_faults(carried, embedded("walk").fps).skate < 0.12
