"""Units of compiled code: a run compiles what it uses, later processes load it, and all call paths agree."""

import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controllers.curves.trajectory import Trajectory
from controllers.errors import ControllerError
from controllers.fields.algebra.program import evaluate
from controllers.fields.follow import Follow
from controllers.haptic_map.cylindrical import Cylindrical, cylindrical_map
from controllers.haptic_map.expressive import express
from controllers.haptic_map.map_stages import MAP_ARGUMENTS, evaluate_map, kernels_of
from controllers.haptic_map.robot_arm import robot_arm_map
from controllers.state import HandState, stylus_path
from experiments.setups.maps.robot_arm import robot_arm_map as default_arm_map
from experiments.setups.parts.expression import expressive_figure
from models.mocap.library import embedded
from models.robot_arm.spec import arm_model
from sim.compilation import kernel_units
from sim.compilation.kernel_units import law_units, linked_stages
from sim.compilation.unit_cache import cache_folder
from sim.compilation.units import Unit
from sim.reference.reference import map_derivatives, map_poses

ARM = default_arm_map(arm_model(), 1.5)
FIELD = Follow(Trajectory.circle(0.05, 4.0), 300.0, 4.0, 0.02).program()


def test_maps_and_laws_are_linked_by_kernel_address():
    stages, laws = linked_stages(ARM.compiled().stages), law_units((FIELD + FIELD).limited(2.0))
    assert kernels_of(stages) == (robot_arm_map,)
    assert len(laws) == 1
    assert laws.all()
    assert stages[0, 2] == Unit.of(robot_arm_map, *MAP_ARGUMENTS).address() != 0
    np.testing.assert_array_equal(linked_stages(ARM.compiled().stages), stages)


def test_unpickled_map_has_the_same_kernels():
    walk = embedded("walk")
    haptic_map = expressive_figure(Cylindrical([(walk.poses, walk.fps)] * 4, (0.03, 0.07), (-0.02, 0.02)))
    copied = pickle.loads(pickle.dumps(haptic_map))
    assert kernels_of(copied.compiled().stages) == (cylindrical_map, express)


def test_map_called_by_address_equals_python_bit_for_bit():
    points = stylus_path(np.random.default_rng(1).uniform(-0.05, 0.05, (20, 3)))
    np.testing.assert_array_equal(map_poses(ARM, points), [ARM.pose(x) for x in points])


def test_linked_unit_is_also_called_from_python():
    linked_stages(ARM.compiled().stages)
    kernel: Any = robot_arm_map
    units = list(kernel.overloads)
    assert MAP_ARGUMENTS in units
    ARM.pose(np.array([0.05, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]))
    assert list(kernel.overloads) == units
    assert kernel._cache.cache_path == str(cache_folder())


def test_derivative_called_by_address_equals_python_bit_for_bit():
    points = stylus_path(np.random.default_rng(2).uniform(-0.05, 0.05, (5, 3)))
    np.testing.assert_array_equal(map_derivatives(ARM, points), [ARM.jacobian(x) for x in points])


def test_field_loaded_from_disk_equals_python_bit_for_bit():
    program, units = (FIELD + FIELD).limited(2.0), law_units(FIELD)
    named, other, wrench, linked_wrench = program.fresh_memory(), program.fresh_memory(), np.empty(6), np.empty(6)
    for t in np.linspace(0.0, 4.0, 50):
        hand = HandState.at((0.05 * np.cos(t), 0.04 * np.sin(t), 0.01), (0.1, 0.0, 0.0), t).vector()
        evaluate(*program.compiled(), named, hand, wrench)
        evaluate(units, program.ops, program.params, other, hand, linked_wrench)
        np.testing.assert_array_equal(linked_wrench, wrench)
        np.testing.assert_array_equal(other, named)


def test_unlinked_map_or_law_is_an_error_and_not_a_crash():
    stages, params, memory, _ = ARM.compiled()
    with pytest.raises(ControllerError, match="map is not compiled; its stages are not linked"):
        evaluate_map(stages, params, np.zeros(7), memory, np.empty(ARM.nq))
    units, hand = np.zeros(1, dtype=np.int64), HandState.at((0.0, 0.0, 0.0)).vector()
    with pytest.raises(ControllerError, match="kernel of a law of this field is not compiled"):
        evaluate(units, FIELD.ops, FIELD.params, FIELD.fresh_memory(), hand, np.empty(6))


_PROCESS = """
from controllers.haptic_map.map_stages import MAP_ARGUMENTS
from controllers.haptic_map.robot_arm import robot_arm_map
from sim.compilation import kernel_units
from sim.compilation.units import Unit, unit_function
Unit.of(robot_arm_map, *MAP_ARGUMENTS).address()
unit = unit_function("controllers.haptic_map.robot_arm", "robot_arm_map")
print(sum(unit.stats.cache_hits.values()), sum(unit.stats.cache_misses.values()), kernel_units.__file__)
"""


@pytest.mark.slow
def test_next_process_loads_the_unit_also_from_a_copy_of_the_sources(tmp_path):
    here, copy = Path(kernel_units.__file__).parents[2], tmp_path / "copy"
    for package in ("geometry", "models", "controllers", "sim"):
        shutil.copytree(here / package, copy / package, ignore=shutil.ignore_patterns("__pycache__"))
    outputs = [
        subprocess.run(
            [sys.executable, "-c", _PROCESS], check=True, capture_output=True, text=True, cwd=sources,
            env=os.environ | {"HVF_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(sources)},
        ).stdout.split()
        for sources in (here, here, copy)
    ]  # fmt: skip
    assert [row[:2] for row in outputs] == [["0", "1"], ["1", "0"], ["1", "0"]]
    assert [Path(row[2]).parents[2] for row in outputs] == [here, here, copy]
