"""Hands in crossing rivers on the MuJoCo Phantom, from any state and with any push; certificates against them.

``python -m experiments.switching_trials 40`` draws rivers and compares what is certified with what happens.
"""

import sys
from collections import Counter
from dataclasses import replace

import mujoco
import numpy as np
import numpy.typing as npt

from controllers.certificates.hand import HandImpedance
from controllers.certificates.sampling import Sampling
from controllers.certificates.switching import Keeping, Sharing
from controllers.certificates.switching_search import Course, Push, failure
from controllers.fields.bundle import RiverBundle
from controllers.fields.higher_order import HigherOrder, higher_order_wrench
from controllers.fields.instructions import TRACE_RIVER
from experiments.certified_rivers import certified_bundle
from experiments.certify import phantom_device
from experiments.field_figures import SPEED, straight_river
from experiments.modes import ADMISSION, SIGMA
from experiments.trial_simulation import CLOSURE, trial_model
from models.phantom.kinematics import jacobian, vector_to_hand_frame
from models.scene import PHANTOM
from sim.devices.phantom_port import ARM_JOINTS, actuate, phantom_port, sense
from sim.world import phantom_angles

Array = npt.NDArray[np.float64]

SUBSTEPS = 8


def simulated_course(
    field: HigherOrder, sampling: Sampling, start: Array, velocity: Array, seconds: float, push: Push | None = None
) -> Course:
    """`switching_search.course` on the whole linkage in MuJoCo, with Coulomb friction, weight and encoders.

    Sensing, law and actuation are the servo's kernels, called tick by tick. The push acts as motor torques.
    """
    model = trial_model(HandImpedance(), sampling.period / SUBSTEPS, True, mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    data = mujoco.MjData(model)
    port = phantom_port(model, data, sampling.period, sampling.cutoff)
    theta = np.array(phantom_angles(start))
    columns = [vector_to_hand_frame(column) for column in np.array(jacobian(theta)).T]
    rate = np.linalg.solve(np.array(columns).T, velocity)
    for i, name in enumerate((*ARM_JOINTS, "elbow", "twin")):
        joint = data.joint(PHANTOM + name)
        joint.qpos[0], joint.qvel[0] = (CLOSURE @ theta)[i], (CLOSURE @ rate)[i]
    mujoco.mj_forward(model, data)
    # The filter knows the velocity from before.
    port.memory[:3], port.memory[6:9], port.memory[12], port.hand[4] = theta, rate, 1.0, 1.0
    program = field.program()
    memory, wrench = program.fresh_memory(), np.zeros(6)
    at, slot = int(program.ops[0, 1]), int(program.ops[0, 2])
    n = round(seconds / sampling.period)
    p, river = np.zeros((n, 3)), np.zeros(n)
    for k in range(n):
        t = k * sampling.period
        sense(port, t, 0.0)
        higher_order_wrench(program.params, at, 0, memory, slot, port.hand, wrench)
        p[k], river[k] = port.hand[1:4], memory[TRACE_RIVER]
        force = wrench[:3].copy()
        if push is not None and push.start <= t < push.start + push.duration:
            force += push.force
        actuate(port, force)
        mujoco.mj_step(model, data, SUBSTEPS)
    return Course(p, river)


def straight_pair(
    degrees: float, form: str, hysteresis: float, drag: float = 4.0, admission: float = ADMISSION
) -> HigherOrder:
    """Two straight rivers that cross in the origin of H; hysteresis and admission as shares of their speed."""
    rivers = tuple(replace(straight_river(angle), drag=drag) for angle in (0.0, degrees))
    scale = (admission * SPEED, SIGMA * SPEED, hysteresis * SPEED)
    return HigherOrder(RiverBundle(rivers, ("1", "2")), *scale, form)  # pyright: ignore[reportArgumentType]


def trial(rng: np.random.Generator) -> tuple[bool, bool]:
    """Random rivers and a push as strong as is certified, else 1 N: whether certified, and whether the hand is kept."""
    field = straight_pair(
        float(rng.uniform(5.0, 90.0)), "discrete", float(rng.uniform(0.0, 3.0)), float(rng.uniform(4.0, 20.0))
    )
    sampling = Sampling(float(rng.choice([5e-4, 1e-3])), 0.0, float(rng.uniform(25.0, 100.0)))
    first, second = certified_bundle(field.bundle, phantom_device(), sampling)
    sharing = Sharing(field.admission, field.sigma, field.hysteresis, field.form)
    allowed = Keeping(first, (second,), sharing).allowed(2.0)
    direction = rng.normal(size=3)
    force = (allowed if allowed > 0.0 else 1.0) * direction / np.linalg.norm(direction)
    push = Push(tuple(force.tolist()), float(rng.uniform(0.2, 0.6)), float(rng.uniform(0.05, 0.4)))
    way = simulated_course(field, sampling, first.curve.point(0.2), first.curve.velocity(0.2), 1.2, push)
    kept = failure(way.river[1:], sampling.period, 0, False) is None
    return allowed > 0.0, kept


def trials(number: int, seed: int = 1) -> Counter[tuple[bool, bool]]:
    """How many of some trials were (certified, kept)."""
    rng = np.random.default_rng(seed)
    return Counter(trial(rng) for _ in range(number))


if __name__ == "__main__":
    for (certified, kept), times in sorted(trials(int(sys.argv[1])).items()):
        print(f"certified {certified}, kept {kept}: {times}")
