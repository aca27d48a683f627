"""Simulation of the Phantom's full linkage in crossing rivers, without a hand, from any state and with any push."""

import mujoco
import numpy as np

from controllers.certificates.loop.hand import HandImpedance
from controllers.certificates.loop.sampling import Sampling
from controllers.certificates.switching.switching_search import Course, Push
from controllers.fields.algebra.instructions import TRACE_RIVER
from controllers.fields.algebra.program import evaluate
from controllers.fields.higher_order import HigherOrder
from controllers.state import POSITION
from experiments.certify.trial_simulation import trial_model
from geometry.arrays import Array
from sim.world.phantom_port import actuate, phantom_port, sense, sensed_before
from sim.world.world import place_stylus

SUBSTEPS = 8


def simulated_course(
    field: HigherOrder, sampling: Sampling, start: Array, velocity: Array, seconds: float, push: Push | None
) -> Course:
    """`switching_search.course` with the full linkage in MuJoCo, including Coulomb friction, weight and encoders.

    Sensing, law and actuation are the servo's kernels, called tick by tick. The push acts through the motors.
    """
    model = trial_model(HandImpedance(), sampling.period / SUBSTEPS, True, mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    data = mujoco.MjData(model)
    port = phantom_port(model, data, sampling.period, sampling.cutoff)
    place_stylus(model, data, start, v_H=velocity)
    mujoco.mj_forward(model, data)
    # The velocity filter starts settled at the initial velocity.
    sensed_before(port, data.qpos[list(port.arm_q)], data.qvel[list(port.arm_v)])
    program = field.program()
    memory, wrench = program.fresh_memory(), np.zeros(6)
    n = round(seconds / sampling.period)
    p, river = np.zeros((n, 3)), np.zeros(n)
    for k in range(n):
        t = k * sampling.period
        sense(port, t, 0.0)
        evaluate(*program.compiled(), memory, port.hand, wrench)
        p[k], river[k] = port.hand[POSITION], memory[TRACE_RIVER]
        force = wrench[:3].copy()
        if push is not None and push.start <= t < push.start + push.duration:
            force += push.force
        actuate(port, force)
        mujoco.mj_step(model, data, SUBSTEPS)
    return Course(p, river)
