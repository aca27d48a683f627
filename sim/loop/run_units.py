"""The compilation units that a servo loop needs, listed before any of them is compiled."""

import numpy as np
from numba import typeof, types

from controllers.fields.algebra.law import Program
from sim.body.drive import follow_units
from sim.compilation.kernel_units import units_of_laws, units_of_map
from sim.compilation.units import Unit
from sim.devices.device import device_units
from sim.loop.loop import make_logs
from sim.loop.servo import Servo, run_block
from sim.reference.reference import poses_unit


def run_units(servo: Servo, program: Program) -> tuple[Unit, ...]:
    """Units of the loop over a servo, of all kernels it calls, and of `poses_along`, used at start and end of a run.

    Parameters
    ----------
    servo : Servo
        With all arrays that it will have; addresses of kernels may still be missing (see `Servo.linked`).
    program : Program
        The program of its field.
    """
    ticks, frames = make_logs(servo, servo.figure_ticks)
    number, flag, reference = types.int64, types.boolean, servo.reference
    stages = np.concatenate([reference.stages, servo.field.maps.stages])
    return (
        Unit.of(run_block, typeof(servo), number, number, flag, typeof(ticks), typeof(frames)),
        *device_units(servo.device),
        *follow_units(servo.figure, reference),
        *units_of_map(stages),
        *units_of_laws(program),
        poses_unit(),
    )
