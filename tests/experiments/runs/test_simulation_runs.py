"""Simulations from Python: runs in memory, their results, sweeps, ticks, own maps that fail, replay in a notebook."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hvf
from experiments.runs import map_objects
from sim.world.world import World


@pytest.fixture(scope="module")
def run(sim: hvf.Simulation) -> hvf.Run:
    return sim.run(0.5)


def test_run_gives_measures_channels_animation_page_and_table(tmp_path: Path) -> None:
    curve = hvf.circle(radius=0.0477, lap=2.0)
    run = hvf.Simulation(
        device=hvf.Phantom(), field=(hvf.Follow(curve, k_r=300, b_d=8) + hvf.law(lambda hand: (0, 0, 0))).limited(8.0),
        haptic_map=hvf.Cylindrical(hvf.clips("walk", "jump"), around=curve), figure=hvf.Figure(kind="kinematic"),
        user=hvf.User(pushes=[hvf.Push(at=2.5, seconds=0.5, force=2.5)]), seed=1,
    ).run(4.0)  # fmt: skip
    assert isinstance(run, hvf.Run)
    assert run.summary.path.deviation_rms < 1e-3
    assert run.ticks["force"].shape == (4000, 3)
    edited = run.to_bvh(tmp_path / "edited.bvh")
    assert hvf.load(edited, raw=True).duration == pytest.approx(4.0, abs=0.1)  # else its cycle is prepared
    assert run.report().stat().st_size > 1e5
    assert {"force_0", "p_2"} <= set(run.frame().columns)


def test_summary_counts_laps_of_the_paced_curve() -> None:
    """In a slow lap friction is a fifth of the drive, by which `paced` shortens the field's curve."""
    curve = hvf.circle(lap=16.0)
    run = hvf.Simulation(
        field=hvf.Follow(hvf.paced(curve, drag=8, stiffness=300), k_r=300, b_d=8),
        haptic_map=hvf.Cylindrical(hvf.clips("cheer"), around=curve), figure=hvf.Figure(kind="kinematic"),
    ).run(4.0)  # fmt: skip
    assert run.summary.path.laps == pytest.approx(4.0 / 16.0, rel=0.05)


def test_summary_counts_laps_of_a_curve_that_is_not_the_maps() -> None:
    around, small = hvf.circle(lap=4.0), hvf.circle(radius=0.03, lap=1.0)
    haptic_map = hvf.Cylindrical(hvf.clips("cheer"), around=around)
    run = hvf.Simulation(
        field=hvf.Follow(small, k_r=300, b_d=8), haptic_map=haptic_map, figure=hvf.Figure(kind="none")
    ).run(3.0)
    x, y, _ = run.ticks["p"].T
    turns = np.ptp(np.unwrap(np.arctan2(y, x))) / (2.0 * np.pi)
    assert turns > 2.0
    assert run.summary.path.laps == pytest.approx(turns, rel=0.02)


def test_rivers_of_a_bundle_are_its_curves() -> None:
    curves = hvf.circle(lap=4.0), hvf.circle(radius=0.03, lap=1.0)
    bundle = hvf.RiverBundle(tuple(map(hvf.River, curves)), ("outer", "inner"))
    assert bundle.curves == bundle.program().curves == curves


def test_sweep_gives_its_values(sim: hvf.Simulation) -> None:
    *_, last = hvf.sweep(sim, {"field.k_r": [100, 800]}, seconds=0.1, threads=2)
    assert isinstance(last, hvf.Swept)
    assert last.values == {"field.k_r": 800}


@pytest.mark.parametrize("parallel", [False, True])
def test_map_is_fitted_to_a_field_with_its_flow(parallel: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """As by `hvf run`: run, cheer and ginga fall in one flow, and stand with half of the arms in the other."""

    def make_parts(*arguments: object) -> None:
        raise hvf.ParameterError(f"fitted to {arguments[-1]}")

    monkeypatch.setattr(hvf.Composite, "make_parts", staticmethod(make_parts))
    curve = hvf.circle(lap=2.0)
    field = hvf.Follow(curve, k_r=300, b_d=8, parallel=parallel).limited(8.0)
    with pytest.raises(hvf.ParameterError, match=f"fitted to {parallel}"):
        hvf.Simulation(field=field, haptic_map=hvf.Composite(hvf.clips("walk"), around=curve)).session(1.0)


@pytest.mark.parametrize(
    ("pushes", "kind", "fitted"), [(1, "physical", True), (0, "physical", False), (1, "none", False)]
)
def test_lifted_map_is_fitted_to_a_hand_that_pushes_a_physical_figure(
    pushes: int, kind: str, fitted: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As by `hvf run`: a walk whose feet a push dragged by 4 cm keeps its legs."""

    def fit(*arguments: object) -> None:
        raise hvf.ParameterError(f"fitted to {arguments[-1]}")

    hvf.lift(["squat_dance", "cheer"], tmp_path / "map.npz")
    lifted = hvf.Lifted(tmp_path / "map.npz")
    monkeypatch.setattr(map_objects, "fitted_to_pushes", fit)
    user = hvf.User(pushes=[hvf.Push(at=0.5, seconds=0.3, force=2.5)] * pushes)
    field, world = hvf.Follow(lifted.around, k_r=300, b_d=8, parallel=True).limited(8.0), World(kind=kind)
    if fitted:
        with pytest.raises(hvf.ParameterError, match="fitted to True"):
            hvf.Simulation(field=field, haptic_map=lifted, user=user).session(1.0)
    else:
        lifted.parts(world, field, bool(user.pushes))


def test_repr_of_public_objects_is_short(sim: hvf.Simulation, run: hvf.Run) -> None:
    values = [sim, sim.field, sim.haptic_map, run, run.ticks, hvf.circle(), hvf.clips("walk")[0], hvf.persona("median")]
    for value in values:
        assert len(repr(value)) < 600, repr(value)
        assert "array(" not in repr(value), repr(value)
        assert "0x" not in repr(value), repr(value)


def test_channels_of_an_unreferenced_run_can_be_read(sim: hvf.Simulation) -> None:
    assert sim.run(0.1).ticks["p"].shape == (100, 3)


@pytest.mark.slow
def test_run_in_a_relative_folder_is_read_from_any_working_directory(
    sim: hvf.Simulation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    run = sim.run(0.1, record="mine")
    (tmp_path / "other").mkdir()
    monkeypatch.chdir("other")
    assert run.ticks["p"].shape == (100, 3)


class Failing(hvf.HapticMap):
    """A map that fails once the hand has moved: `fails` raises, or returns what is no pose."""

    def __init__(self, fails: Callable[[], Any]):
        self.fails = fails

    def pose(self, x: np.ndarray) -> np.ndarray:
        return self.fails() if x[1] > 1e-3 else hvf.rest_pose()


def no_such_place() -> None:
    raise ValueError("no such place")


def ctrl_c() -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("fails", "kind", "message"),
    [
        (no_such_place, ValueError, "no such place"),
        (ctrl_c, KeyboardInterrupt, None),
        (lambda: np.zeros(3), hvf.ParameterError, r"gave a pose of shape \(3,\) at p = .*; expected 75 finite numbers"),
    ],
)
def test_failing_own_map_ends_the_run_and_leaves_no_folder(
    fails: Callable[[], Any],
    kind: type[BaseException],
    message: str | None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    field = hvf.Follow(hvf.circle(lap=2.0), k_r=300, b_d=8)
    sim = hvf.Simulation(field=field, haptic_map=Failing(fails), figure=hvf.Figure(kind="kinematic"))
    with pytest.raises(kind, match=message):
        sim.run(0.5)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_html_repr_of_run_contains_the_replay(run: hvf.Run) -> None:
    page = run._repr_html_()
    assert page.startswith("<iframe srcdoc=")
    assert "Replay in 3D" in page


def test_simulation_is_iterated_tick_by_tick(sim: hvf.Simulation) -> None:
    times = []
    for tick in sim:
        times.append(tick.hand.t)
        if len(times) == 5:
            break
    np.testing.assert_allclose(np.diff(times), 1e-3, atol=1e-12)


def test_own_map_of_another_size_than_the_figure_is_refused() -> None:
    class Small(hvf.HapticMap):
        def pose(self, x):
            return np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])

    with pytest.raises(hvf.ParameterError, match="poses of Small have 7 numbers; the figure's have 75"):
        hvf.Simulation(field=hvf.Follow(hvf.circle(), k_r=300, b_d=8), haptic_map=Small()).run(0.5)
