"""Distance by which a transition of a lifted map moves the figure over the floor, and the remark before the run."""

from pathlib import Path

import numpy as np
import pytest

from controllers.haptic_map.lifted import Lifted
from controllers.haptic_map.lifting.room import Room
from controllers.haptic_map.lifting.transitions import MapTransition
from experiments.config.options import run_config
from experiments.files.map_files import load_figure_map, save_map
from experiments.lifting.lift import lift_clips
from experiments.setups.modes.lifted_runs import carried_over, places_apart
from experiments.setups.setups import map_parts
from models.humanoid.skeleton import figure_model
from models.mocap.library import embedded
from models.mocap.motion.clip import Clip
from models.mocap.readers.own_bvh import write_bvh

DISTANCE = 1.5  # [m] by which the cheering figure moves away and back in a lap


@pytest.fixture(scope="module")
def wandering_map_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A lifted map of a dance on the spot, and of a cheer that goes to a place and back in a lap."""
    folder, cheer = tmp_path_factory.mktemp("wandering"), embedded("cheer")
    poses = cheer.poses.copy()
    poses[:, 0] += DISTANCE * np.sin(np.pi * np.linspace(0.0, 1.0, len(poses))) ** 2
    write_bvh(Clip(poses, cheer.fps, "to_and_fro"), folder / "to_and_fro.bvh")
    haptic_map = lift_clips(["squat_dance", str(folder / "to_and_fro.bvh")], Room(), raw=True).haptic_map
    save_map(haptic_map, folder / "map.npz")
    return folder / "map.npz"


def _with_transition_at(haptic_map: Lifted, angle: float) -> Lifted:
    haptic_map.transitions = (MapTransition(0, 1, angle, 0.1, 0.1),)
    return haptic_map


def test_distance_between_places_is_measured_and_large_ones_are_reported(wandering_map_file: Path) -> None:
    haptic_map, _ = load_figure_map(wandering_map_file)
    angles = np.arange(0.0, 2.0 * np.pi, 0.2)
    distances = np.array([places_apart(haptic_map, MapTransition(0, 1, angle, 0.1, 0.1)) for angle in angles])
    assert distances.min() < 0.15
    # Mean places over a lap coincide: the cheer moves half of the distance to either side of it.
    assert distances.max() == pytest.approx(DISTANCE / 2.0, abs=0.1)
    near, far = (MapTransition(0, 1, float(angles[k]), 0.1, 0.1) for k in (distances.argmin(), distances.argmax()))
    assert carried_over(haptic_map, near)[1] == ()
    (remark,) = carried_over(haptic_map, far)[1]
    assert remark.startswith("where squat_dance and to_and_fro agree, their positions on the floor are 0.")


@pytest.mark.parametrize(("user", "figure", "warnings"), [("push", "physical", 1), ("relaxed", "physical", 0)])
def test_pushing_hand_is_warned_of_distant_transition_places(
    wandering_map_file: Path, tmp_path: Path, user: str, figure: str, warnings: int
) -> None:
    haptic_map, _ = load_figure_map(wandering_map_file)
    angles = np.arange(0.0, 2.0 * np.pi, 0.2)
    far = max(angles, key=lambda angle: places_apart(haptic_map, MapTransition(0, 1, angle, 0.1, 0.1)))
    save_map(_with_transition_at(haptic_map, float(far)), tmp_path / "map.npz")
    config = run_config(map=str(tmp_path / "map.npz"), mode="rivers", user=user, figure=figure, seconds=1.0)
    remarks = map_parts(config, figure_model()).refine(physical=True).remarks
    assert sum("a push over carries the figure" in remark for remark in remarks) == warnings
