"""The public face: parts that are put together from Python, numbers that are swept, fields that are certified."""

import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hvf
from controllers.certificates.loop.hand import NO_HANDS
from experiments.cli import main
from experiments.files.device_files import save_device
from experiments.results.folder import claimed
from experiments.runs.sweep import with_values

CURVE = hvf.circle(lap=2.0)


@hvf.law
def level(hand, k=50.0):
    return (0.0, 0.0, -k * hand.p[2])


def simulation(field: hvf.Law, **parts: object) -> hvf.Simulation:
    around = hvf.Cylindrical(hvf.clips("cheer"), around=CURVE)
    return hvf.Simulation(field=field, haptic_map=around, **parts)  # pyright: ignore[reportArgumentType]


def test_every_name_that_is_promised_is_there() -> None:
    assert all(hasattr(hvf, name) for name in hvf.__all__)
    assert hvf.__version__


@pytest.mark.slow
def test_importing_the_face_starts_no_viewer_and_no_plots() -> None:
    script = "import sys, hvf; sys.exit(any(name in sys.modules for name in ('viser', 'matplotlib.pyplot')))"
    root = Path(__file__).resolve().parents[3]
    assert subprocess.run([sys.executable, "-c", script], cwd=root, check=False).returncode == 0


def test_a_number_of_one_law_of_a_composed_field_is_set_and_the_composition_stays() -> None:
    sim = simulation((hvf.Follow(CURVE, k_r=300, b_d=8) + level).limited(8.0))
    other = with_values(sim, {"field.k_r": 100.0, "seed": 3, "clock.physics_step": 5e-4})
    assert (other.seed, other.clock.physics_step) == (3, 5e-4)
    hand = hvf.HandState.at([0.04, 0.0, -0.01])
    by_hand = (hvf.Follow(CURVE, k_r=100, b_d=8) + level).limited(8.0)
    np.testing.assert_array_equal(other.field.wrench(hand).force, by_hand.wrench(hand).force)
    assert sim.field.program().laws[0].k_r == 300  # pyright: ignore[reportAttributeAccessIssue]


def test_a_simulation_has_the_parameters_of_its_device_file(tmp_path: Path) -> None:
    save_device({"format": "hvf-device-1", "coulomb": {"value": [0.011, 0.012, 0.013]}}, tmp_path / "device.json")
    device = hvf.Phantom(device_file=str(tmp_path / "device.json"))
    world = simulation(level, device=device, figure=hvf.Figure(kind="none")).session().world
    losses = [world.model.joint(f"phantom/theta{i}").frictionloss[0] for i in (1, 2, 3)]
    assert losses == [0.011, 0.012, 0.013]


@pytest.mark.parametrize("path", ["field.k", "field.level.k"])
def test_a_parameter_of_a_law_of_ones_own_is_such_a_number(path: str) -> None:
    sim = simulation((hvf.Follow(CURVE, k_r=300, b_d=8) + level).limited(8.0))
    hand = hvf.HandState.at([0.04, 0.0, -0.01])
    by_hand = (hvf.Follow(CURVE, k_r=300, b_d=8) + level(k=80.0)).limited(8.0)
    np.testing.assert_array_equal(with_values(sim, {path: 80.0}).field.wrench(hand).force, by_hand.wrench(hand).force)
    alone = with_values(simulation(level), {"field.k": 80.0})
    np.testing.assert_array_equal(alone.field.wrench(hand).force, level(k=80.0).wrench(hand).force)
    with pytest.raises(hvf.ParameterError, match=r"law level .* has no parameter b"):
        with_values(sim, {"field.level.b": 1.0})


def test_a_bound_of_a_limited_field_is_such_a_number() -> None:
    sim = simulation((hvf.Follow(CURVE, k_r=300, b_d=8) + level).limited(8.0))
    hand = hvf.HandState.at([0.1, 0.0, -0.01])
    for path, bounds in (("force", (2.0,)), ("torque", (8.0, 0.1))):
        by_hand = (hvf.Follow(CURVE, k_r=300, b_d=8) + level).limited(*bounds)
        other = with_values(sim, {f"field.limited.{path}": bounds[-1]})
        np.testing.assert_array_equal(other.field.program().params, by_hand.params)
        np.testing.assert_array_equal(other.field.wrench(hand).force, by_hand.wrench(hand).force)
    assert np.linalg.norm(sim.field.wrench(hand).force) == pytest.approx(8.0)
    for field, path, said in (
        (
            level + level,
            "limited.force",
            r"^field.limited.force: .* limited 0 times; expected limited.force or",
        ),
        (level.limited(1.0).limited(2.0), "limited.force", "is limited 2 times"),
        (level.limited(1.0), "limited.power", "expected limited.force or limited.torque"),
        (level.limited(1.0), "limited", "expected limited.force or limited.torque"),
        (level.limited(1.0), "force", "0 laws of the field have 'force'; expected one among level, or limited$"),
    ):
        with pytest.raises(hvf.ParameterError, match=said):
            with_values(simulation(field), {f"field.{path}": 1.0})
    with pytest.raises(hvf.ParameterError, match=r"field.limited.force must be at least 0 N, got -1"):
        with_values(sim, {"field.limited.force": -1.0})


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("field.stiffness", "0 laws of the field have 'stiffness'; expected one among Follow, level"),
        ("clock.rate", "Clock has no 'rate'; expected some of servo_period, physics_step"),
        ("speed", "Simulation has no 'speed'"),
    ],
)
def test_a_number_that_is_not_there_is_named(path: str, said: str) -> None:
    with pytest.raises(hvf.ParameterError, match="^" + path) as error:
        with_values(simulation(hvf.Follow(CURVE, k_r=300, b_d=8) + level), {path: 1.0})
    assert said in str(error.value)


def test_a_run_that_is_too_short_is_refused_before_anything_is_made() -> None:
    with pytest.raises(hvf.ParameterError, match=r"expected 0\.004 s or more"):
        simulation(hvf.Follow(CURVE, k_r=300, b_d=8)).run(0.001)


def test_a_run_that_no_disk_holds_is_refused_before_anything_is_made() -> None:
    with pytest.raises(hvf.ParameterError, match="expected less than"):
        simulation(hvf.Follow(CURVE, k_r=300, b_d=8)).run(1e300)


@pytest.mark.parametrize(
    ("part", "said"),
    [
        ({"field": lambda hand: (0.0, 0.0, 0.0)}, r"^field is <function .*expected a law of force, .*@hvf\.law"),
        ({"haptic_map": hvf.clips("walk")[0]}, r"^haptic_map is <clip 'walk'.*expected a map"),
        ({"figure": "none"}, r"^figure is 'none'; expected hvf\.Figure"),
        ({"user": None}, r"^user is None"),
        ({"seed": 1.5}, r"^seed is 1\.5; expected a whole number"),
        ({"seed": -1}, r"^seed is -1"),
    ],
)
def test_a_part_of_another_kind_is_named_with_what_would_be_right(part: dict[str, Any], said: str) -> None:
    with pytest.raises(hvf.ParameterError, match=said):
        replace(simulation(hvf.Follow(CURVE, k_r=300, b_d=8)), **part)


def test_a_folder_into_which_a_run_is_being_written_is_refused_and_keeps_what_it_holds(tmp_path: Path) -> None:
    sim = simulation(hvf.Follow(CURVE, k_r=300, b_d=8))
    with claimed(tmp_path):
        (tmp_path / "run.h5").write_bytes(b"precious")
        with pytest.raises(hvf.SimError, match="another run is being written into it"):
            sim.run(0.1, record=tmp_path, overwrite=True)
    assert (tmp_path / "run.h5").read_bytes() == b"precious"


class Shrinking(hvf.HapticMap):
    """A map whose poses lose their joints after some calls."""

    def __init__(self) -> None:
        self.asked = 0

    def pose(self, x: np.ndarray, memory: np.ndarray | None = None) -> np.ndarray:
        self.asked += 1
        return hvf.rest_pose()[: 75 if self.asked < 30 else 3]


def test_a_map_that_fails_in_a_tick_says_so_itself_and_leaves_no_folder(monkeypatch, tmp_path: Path) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    field = hvf.Follow(CURVE, k_r=300, b_d=8)
    sim = hvf.Simulation(field=field, haptic_map=Shrinking(), figure=hvf.Figure(kind="kinematic"))
    with pytest.raises(hvf.ParameterError, match=r"gave a pose of shape \(3,\) at p = .*; expected 75 finite numbers"):
        sim.run(0.1)
    assert not list(tmp_path.iterdir())


def test_ctrl_c_ends_a_run_with_a_map_in_python() -> None:
    class Interrupted(hvf.HapticMap):
        def pose(self, x: np.ndarray, memory: np.ndarray | None = None) -> np.ndarray:
            if x[1] > 1e-3:
                raise KeyboardInterrupt
            return hvf.rest_pose()

    field = hvf.Follow(CURVE, k_r=300, b_d=8)
    sim = hvf.Simulation(field=field, haptic_map=Interrupted(), figure=hvf.Figure(kind="kinematic"))
    with pytest.raises(KeyboardInterrupt):
        sim.run(0.5)


def reading(hand):
    force = 0.0
    for i in range(3 if hand.t < 5e-3 else 4):
        force += 0.1 * hand.p[i]
    return force, 0.0, 0.0


def test_a_compiled_law_that_raises_in_a_tick_is_named() -> None:
    sim = simulation(hvf.Follow(CURVE, k_r=300, b_d=8) + hvf.law(compiled=True)(reading))
    said = r"law reading \(.*test_public_face\.py, line \d+\) raised IndexError: .*; for a hand at p = \[0\.0"
    with pytest.raises(hvf.ParameterError, match=said):
        sim.run(0.1)
    with pytest.raises(hvf.ParameterError, match=said):
        for _ in zip(range(100), sim, strict=False):
            pass


class Unlike(hvf.HapticMap):
    """A map with a derivative of another shape."""

    def pose(self, x: np.ndarray, memory: np.ndarray | None = None) -> np.ndarray:
        return hvf.rest_pose()

    def jacobian(self, x: np.ndarray, memory: np.ndarray | None = None) -> np.ndarray:
        return np.zeros((3, 3))


def test_a_map_with_a_derivative_of_another_shape_is_refused() -> None:
    field = hvf.Follow(CURVE, k_r=300, b_d=8)
    sim = hvf.Simulation(field=field, haptic_map=Unlike(), figure=hvf.Figure(kind="kinematic"))
    with pytest.raises(hvf.ParameterError, match=r"gave a jacobian of shape \(3, 3\); expected \(57, 6\)"):
        sim.run(0.1)


def test_what_cannot_be_swept_tuned_or_recorded_is_refused_before_it_begins() -> None:
    sim = simulation(hvf.Follow(CURVE, k_r=300, b_d=8))
    with pytest.raises(hvf.ParameterError, match="threads is 0"):
        next(hvf.sweep(sim, {"field.k_r": [100.0]}, threads=0))
    with pytest.raises(hvf.ParameterError, match="record is empty"):
        sim.run(0.1, record="")
    with pytest.raises(hvf.ParameterError, match="the space is empty"):
        hvf.tune(sim, {}, lambda run: 1.0)
    for bounds in ((500.0, 50.0), (50.0,), (50.0, float("inf"))):
        with pytest.raises(hvf.ParameterError, match=r"^field\.k_r is .*expected the lowest and the highest value"):
            hvf.tune(sim, {"field.k_r": bounds}, lambda run: 1.0)  # pyright: ignore[reportArgumentType]


@pytest.mark.slow
@pytest.mark.parametrize("cost", [float("nan"), None, (1.0, 2.0)])
def test_a_cost_that_is_no_number_ends_a_search(cost: Any) -> None:
    sim = simulation(hvf.Follow(CURVE, k_r=300, b_d=8))
    with pytest.raises(hvf.ParameterError, match=r"^the cost at {'field\.k_r': .*expected 1 finite"):
        hvf.tune(sim, {"field.k_r": (100.0, 101.0)}, lambda run: cost, seconds=0.1, search=hvf.Search(candidates=1))


@pytest.mark.slow
def test_a_certificate_is_of_the_very_field() -> None:
    alone = hvf.certify(simulation(hvf.Follow(CURVE, k_r=300, b_d=8)))
    both = hvf.certify(simulation((hvf.Follow(CURVE, k_r=300, b_d=8) + level).limited(8.0)))
    stiff = hvf.certify(simulation(hvf.Follow(CURVE, k_r=300, b_d=8) + level(k=60000.0)))
    assert (alone.stability.verdict, both.stability.verdict) == ("certified", "certified")
    assert any("8 N" in assumed for assumed in both.stability.assumptions)
    # Sixty newtons for a millimetre are far above what the loop bears, though FOLLOW's own gain is low.
    assert stiff.stability.verdict == "refuted"
    assert len({c.inputs_hash for c in (alone, both, stiff)}) == 3


@hvf.law
def soft_floor(hand, k=500.0):
    return 0.0, 0.0, k * hand.p[2] ** 2 if hand.p[2] < 0 else 0.0


def test_what_cannot_be_certified_is_unknown_and_named() -> None:
    curved = hvf.certify(simulation(hvf.Follow(CURVE, k_r=300, b_d=8) + soft_floor)).stability
    gated = hvf.certify(simulation(hvf.Follow(CURVE, k_r=300, b_d=8).gated(hvf.Weight.ball((0, 0, 0), 1.0)))).stability
    assert (curved.verdict, gated.verdict) == ("unknown", "unknown")
    assert "law soft_floor" in curved.reason
    assert "has cases whose force is not linear" in curved.reason
    assert "gated" in gated.reason


@hvf.law
def of_time(hand, k=1e6):
    return k * hand.t * hand.p[0], 0.0, 0.0


@hvf.law
def of_turn(hand, k=10.0):
    return k * hand.q[1] * hand.p[0], k * hand.w[2], 0.0


@hvf.law
def of_switch(hand, k=1e6):
    return k * hand.switch * hand.p[0], 0.0, 0.0


@hvf.law
def with_moment(hand, k=100.0):
    return -k * hand.p[0], 0.0, 0.0, -0.1 * hand.w[0], 0.0, 0.0


@pytest.mark.parametrize(
    ("own", "says"),
    [
        (of_time, "depends on the time of the hand"),
        (of_turn, "depends on the orientation and the angular velocity of the hand"),
        (of_switch, "depends on the switch of the hand"),
    ],
)
def test_nothing_is_certified_of_a_law_that_depends_on_more_than_position_and_velocity(own: hvf.Law, says: str) -> None:
    found = hvf.certify(simulation(hvf.Follow(CURVE, k_r=300, b_d=8) + own), NO_HANDS)
    assert found.stability.verdict in ("unknown", "refuted")
    assert f"the force of law {own.name} " in found.stability.reason
    assert says in found.stability.reason
    assert found.passivity.verdict == "unknown"


def test_a_moment_of_a_law_of_ones_own_is_assumed_not_to_be_felt() -> None:
    told = hvf.certify(simulation(hvf.Follow(CURVE, k_r=300, b_d=8) + with_moment), NO_HANDS).stability
    assert told.verdict == "certified"
    assert any("moment on the stylus is not felt" in assumed for assumed in told.assumptions)


def test_clips_and_version_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["clips"]) == 0
    assert "walk" in capsys.readouterr().out
    assert main(["--version"]) == 0
    assert hvf.__version__ in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["--help"])
    assert "hvf --version prints the version" in capsys.readouterr().out


@pytest.mark.slow
def test_the_package_of_commands_is_run_as_a_module() -> None:
    root = Path(__file__).resolve().parents[3]
    command = [sys.executable, "-m", "experiments", "--version"]
    assert (
        subprocess.run(command, cwd=root, check=True, capture_output=True, text=True).stdout
        == f"hvf {hvf.__version__}\n"
    )


@pytest.mark.slow
def test_kinematic_and_absent_figures_leave_the_stylus_where_it_is() -> None:
    runs = [
        simulation(hvf.Follow(CURVE, k_r=300, b_d=8), figure=hvf.Figure(kind=kind)).run(2.0)
        for kind in ("physical", "kinematic", "none")
    ]
    paths = [run.ticks["p"] for run in runs]
    for path in paths[1:]:
        np.testing.assert_allclose(path, paths[0], atol=2e-5)
    assert runs[0].summary.figure is not None
    assert runs[1].summary.figure is None
    assert runs[2].summary.animation is None
    np.testing.assert_allclose(runs[1].frames["reference"], runs[0].frames["reference"], atol=2e-3)


def test_a_channel_is_looked_for_as_in_any_mapping() -> None:
    run = simulation(hvf.Follow(CURVE, k_r=300, b_d=8), figure=hvf.Figure(kind="none")).run(0.1)
    assert "force" in run.ticks
    assert "forces" not in run.ticks
    assert run.ticks.get("forces") is None
    with pytest.raises(hvf.SimError, match=r"^no channel 'forces'; ticks has .*force, .*tank"):
        run.ticks["forces"]


def test_a_run_without_a_figure_has_no_animation_to_write(tmp_path: Path) -> None:
    run = simulation(hvf.Follow(CURVE, k_r=300, b_d=8), figure=hvf.Figure(kind="none")).run(0.1)
    with pytest.raises(hvf.SimError, match="the run has no figure, and so no animation; expected a run of a f"):
        run.to_bvh(tmp_path / "mine.bvh")
    assert not list(tmp_path.iterdir())


def test_a_run_is_not_pickled_and_says_what_is() -> None:
    session = simulation(level, figure=hvf.Figure(kind="kinematic")).session()
    run = hvf.Run(Path("runs"), None, session)  # pyright: ignore[reportArgumentType] - has not run
    with pytest.raises(hvf.SimError, match="is not pickled; expected its summary, arrays of its channels, or"):
        pickle.dumps(run)


def test_an_animation_is_written_into_a_bvh_alone(tmp_path: Path) -> None:
    session = simulation(level, figure=hvf.Figure(kind="kinematic")).session()
    run = hvf.Run(tmp_path, None, session)  # pyright: ignore[reportArgumentType] - has not run: nothing is measured
    with pytest.raises(hvf.ModelError, match=r"y\.glb: only .*BVH can be written; expected a name that ends in \.bvh"):
        run.to_bvh(tmp_path / "y.glb")
    (tmp_path / "mine.bvh").write_text("mine")
    with pytest.raises(hvf.ModelError, match="is left as it is; expected a new name, or overwrite=True"):
        run.to_bvh(tmp_path / "mine.bvh")
    assert [file.name for file in tmp_path.iterdir()] == ["mine.bvh"]


def test_what_is_printed_of_a_field_and_of_a_certificate_is_read_at_a_glance() -> None:
    field = (0.5 * hvf.Follow(CURVE, k_r=300, b_d=8) + level).limited(8.0)
    said = repr(field)
    assert said.startswith("<field of Follow(curve=<closed curve of 97 samples, 0.3 m in 2 s>, k_r=300, ")
    assert said.endswith("level(k=50.0), joined by gate, add, limit>")
    verdicts = repr(hvf.certify(simulation(hvf.Follow(CURVE, k_r=300, b_d=8))))
    assert len(verdicts) < 1500
    assert "array(" not in verdicts


def test_a_field_is_scaled_from_either_side() -> None:
    follow, hand = hvf.Follow(CURVE, k_r=300, b_d=8), hvf.HandState.at([0.04, 0.0, -0.01])
    np.testing.assert_array_equal((follow * 0.5).wrench(hand).force, (0.5 * follow).wrench(hand).force)


def test_a_number_within_a_sequence_is_not_swept_and_it_is_said_what_is() -> None:
    push = hvf.User(pushes=[hvf.Push(at=0.0, seconds=0.1, force=1.0)])
    sim = simulation(hvf.Follow(CURVE, k_r=300, b_d=8), user=push)
    with pytest.raises(hvf.ParameterError, match=r"user\.pushes is a list; expected whole values of user\.pushes"):
        with_values(sim, {"user.pushes.force": 2.0})
