"""The public interface `hvf`: names, refused parts, own maps and laws, runs and their results."""

import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import hvf
from experiments.cli import main
from experiments.files.device_files import save_device
from experiments.results.folder import locked_folder
from tests.experiments.runs.simulations import CURVE, level, simulation


def test_every_name_in_all_exists() -> None:
    assert all(hasattr(hvf, name) for name in hvf.__all__)
    assert hvf.__version__


def test_errors_of_all_layers_have_one_base(tmp_path: Path) -> None:
    for kind, refused in (
        (hvf.ModelError, lambda: hvf.load(tmp_path / "missing.bvh")),
        (hvf.ControllerError, lambda: hvf.Follow(CURVE, k_r=-1.0, b_d=8)),
        (hvf.SimError, lambda: hvf.Lifted(tmp_path / "missing.npz")),
    ):
        with pytest.raises(hvf.HvfError) as error:
            refused()
        assert isinstance(error.value, kind)


@pytest.mark.slow
def test_importing_hvf_loads_no_viewer_or_plots() -> None:
    script = "import sys, hvf; sys.exit(any(name in sys.modules for name in ('viser', 'matplotlib.pyplot')))"
    root = Path(__file__).resolve().parents[3]
    assert subprocess.run([sys.executable, "-c", script], cwd=root, check=False).returncode == 0


def test_simulation_uses_the_parameters_of_its_device_file(tmp_path: Path) -> None:
    save_device({"format": "hvf-device-1", "coulomb": {"value": [0.011, 0.012, 0.013]}}, tmp_path / "device.json")
    device = hvf.Phantom(device_file=str(tmp_path / "device.json"))
    world = simulation(level, device=device, figure=hvf.Figure(kind="none")).session().world
    losses = [world.model.joint(f"phantom/theta{i}").frictionloss[0] for i in (1, 2, 3)]
    assert losses == [0.011, 0.012, 0.013]


def test_folder_in_use_is_refused_and_unchanged(tmp_path: Path) -> None:
    sim = simulation(hvf.Follow(CURVE, k_r=300, b_d=8))
    with locked_folder(tmp_path):
        (tmp_path / "run.h5").write_bytes(b"precious")
        with pytest.raises(hvf.SimError, match="another run is being written into it"):
            sim.run(0.1, record=tmp_path, overwrite=True)
    assert (tmp_path / "run.h5").read_bytes() == b"precious"


def reading(hand):
    force = 0.0
    for i in range(3 if hand.t < 5e-3 else 4):
        force += 0.1 * hand.p[i]
    return force, 0.0, 0.0


def test_compiled_law_that_raises_is_named() -> None:
    sim = simulation(hvf.Follow(CURVE, k_r=300, b_d=8) + hvf.law(compiled=True)(reading))
    message = r"law reading \(.*test_public_interface\.py, line \d+\) raised IndexError: .*; for a hand at p = \[0\.0"
    with pytest.raises(hvf.ParameterError, match=message):
        sim.run(0.1)
    with pytest.raises(hvf.ParameterError, match=message):
        for _ in zip(range(100), sim, strict=False):
            pass


class Unlike(hvf.HapticMap):
    """A map with a derivative of another shape."""

    def pose(self, x: np.ndarray, memory: np.ndarray | None = None) -> np.ndarray:
        return hvf.rest_pose()

    def jacobian(self, x: np.ndarray, memory: np.ndarray | None = None) -> np.ndarray:
        return np.zeros((3, 3))


def test_own_map_with_wrong_jacobian_shape_is_refused() -> None:
    field = hvf.Follow(CURVE, k_r=300, b_d=8)
    sim = hvf.Simulation(field=field, haptic_map=Unlike(), figure=hvf.Figure(kind="kinematic"))
    with pytest.raises(hvf.ParameterError, match=r"gave a jacobian of shape \(3, 3\); expected \(57, 6\)"):
        sim.run(0.1)


def test_clips_version_and_help_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["clips"]) == 0
    assert "walk" in capsys.readouterr().out
    assert main(["--version"]) == 0
    assert hvf.__version__ in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["--help"])
    assert "hvf --version prints the version" in capsys.readouterr().out


@pytest.mark.slow
def test_experiments_package_runs_as_a_module() -> None:
    root = Path(__file__).resolve().parents[3]
    command = [sys.executable, "-m", "experiments", "--version"]
    assert (
        subprocess.run(command, cwd=root, check=True, capture_output=True, text=True).stdout
        == f"hvf {hvf.__version__}\n"
    )


@pytest.mark.slow
def test_figure_kind_does_not_change_the_stylus_path() -> None:
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


def test_ticks_behave_like_a_mapping() -> None:
    run = simulation(hvf.Follow(CURVE, k_r=300, b_d=8), figure=hvf.Figure(kind="none")).run(0.1)
    assert "force" in run.ticks
    assert "forces" not in run.ticks
    assert run.ticks.get("forces") is None
    with pytest.raises(hvf.SimError, match=r"^no channel 'forces'; ticks has .*force, .*tank"):
        run.ticks["forces"]


def test_bvh_of_run_without_figure_is_refused(tmp_path: Path) -> None:
    run = simulation(hvf.Follow(CURVE, k_r=300, b_d=8), figure=hvf.Figure(kind="none")).run(0.1)
    with pytest.raises(hvf.SimError, match="the run has no figure, and so no animation; expected a run of a f"):
        run.to_bvh(tmp_path / "mine.bvh")
    assert not list(tmp_path.iterdir())


def test_pickling_a_run_is_refused() -> None:
    session = simulation(level, figure=hvf.Figure(kind="kinematic")).session()
    run = hvf.Run(Path("runs"), None, session)  # pyright: ignore[reportArgumentType] - has not run
    with pytest.raises(hvf.SimError, match="is not pickled; expected its summary, arrays of its channels, or"):
        pickle.dumps(run)


def test_animation_is_written_only_to_new_bvh_files(tmp_path: Path) -> None:
    session = simulation(level, figure=hvf.Figure(kind="kinematic")).session()
    run = hvf.Run(tmp_path, None, session)  # pyright: ignore[reportArgumentType] - has not run: nothing is measured
    with pytest.raises(hvf.ModelError, match=r"y\.glb: only .*BVH can be written; expected a name that ends in \.bvh"):
        run.to_bvh(tmp_path / "y.glb")
    (tmp_path / "mine.bvh").write_text("mine")
    with pytest.raises(hvf.ModelError, match="is left as it is; expected a new name, or overwrite=True"):
        run.to_bvh(tmp_path / "mine.bvh")
    assert [file.name for file in tmp_path.iterdir()] == ["mine.bvh"]


@pytest.mark.slow
def test_repr_of_field_and_certificate_is_short() -> None:
    field = (0.5 * hvf.Follow(CURVE, k_r=300, b_d=8) + level).limited(8.0)
    text = repr(field)
    assert text.startswith("<field of Follow(curve=<closed curve of 97 samples, 0.3 m in 2 s>, k_r=300, ")
    assert text.endswith("level(k=50.0), joined by gate, add, limit>")
    verdicts = repr(hvf.certify(simulation(hvf.Follow(CURVE, k_r=300, b_d=8))))
    assert len(verdicts) < 1500
    assert "array(" not in verdicts
