"""Start of a run: it imports nothing that it does not need, and compiles nothing in its own process."""

import json
from pathlib import Path

import numpy as np
import pytest

from controllers.haptic_map.lifted import Lifted
from experiments.files.map_files import save_map
from experiments.fitting.figure_legs import figure_legs
from models.humanoid.skeleton import figure_model
from models.mocap.library import embedded
from tests.experiments.own_process import COMMAND, LISTENER, compiled_names, run_python

HEAVY = (
    "matplotlib", "casadi", "viser", "mjviser", "trimesh", "PIL", "pandas", "statsmodels", "optuna", "dask",
    "scipy.stats", "scipy.signal", "scipy.integrate",
)  # fmt: skip

_IMPORTS = f"""
import sys
import experiments.cli, experiments.runs.run, experiments.setups.wiring
print(*(name for name in {HEAVY} if name in sys.modules))
"""

_EVALUATE_LAW = """
import hvf
import numpy as np
field = hvf.Follow(hvf.circle(radius=0.0477, lap=4.0), k_r=300.0, b_d=8.0)
print(np.linalg.norm(field.wrench(hvf.HandState.at((0.05, 0.0, 0.0)))[0]))
"""

_COMPILES = "from geometry.easing import smooth_step; smooth_step(0.5)"


@pytest.mark.slow
def test_run_imports_no_heavy_module_early() -> None:
    assert not run_python(_IMPORTS).stdout.split()


def test_only_the_named_command_is_imported() -> None:
    code = "import sys, experiments.cli; experiments.cli.parse_command(['track', 'walk']); print(*sys.modules)"
    found = {name for name in run_python(code).stdout.split() if name.startswith("experiments.commands.")}
    assert found == {"experiments.commands.track"}


@pytest.mark.slow
def test_compilation_listener_reports_compiled_functions() -> None:
    assert "compiles smooth_step" in compiled_names(run_python(LISTENER + _COMPILES))


@pytest.mark.slow
def test_law_evaluated_from_python_is_compiled_once_for_all_processes() -> None:
    """As certification does with the program of a run."""
    for completed in (run_python(LISTENER + _EVALUATE_LAW), run_python(LISTENER + _EVALUATE_LAW)):
        assert float(completed.stdout) > 0.0
    assert not {"follow_wrench", "evaluate"} & set(" ".join(compiled_names(completed)).split())


@pytest.fixture(scope="module")
def lifted_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    clips = [embedded(name) for name in ("cheer", "angry")]
    sites = np.tile([[0.05, 0.0], [0.06, 0.0]], (64, 1, 1))
    angles = [np.linspace(0.0, 2.0 * np.pi, clip.n_frames) for clip in clips]
    motions = [(clip.poses, clip.fps) for clip in clips]
    path = tmp_path_factory.mktemp("start") / "map.npz"
    save_map(Lifted(motions, [True, True], angles, sites, figure_legs(figure_model()), ("cheer", "angry")), path)
    return path


@pytest.mark.slow
def test_robot_arm_run_compiles_nothing_in_its_own_process(tmp_path: Path) -> None:
    completed = run_python(
        LISTENER + COMMAND, "run", "--map", "robot-arm", "--seconds", "1.5", "--out", str(tmp_path / "arm")
    )
    assert "The stylus ran" in completed.stdout
    assert compiled_names(completed) == []


# In a separate process, for the peak memory of a process never decreases.
@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [(), ("--map", "lifted"), ("--map", "lifted", "--expressive", "--walls")],
    ids=["cylinder", "lifted", "expressive"],
)
def test_run_compiles_nothing_in_its_own_process_and_needs_less_than_1_gb(
    arguments: tuple[str, ...], lifted_file: Path, tmp_path: Path
) -> None:
    given = [str(lifted_file) if argument == "lifted" else argument for argument in arguments]
    completed = run_python(LISTENER + COMMAND, "run", *given, "--seconds", "0.1", "--out", str(tmp_path / "run"))
    assert "The stylus ran" in completed.stdout
    assert compiled_names(completed) == []
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["speed"]["peak_memory_mb"] < 1000.0
