"""Hands and linkages that look like faults and are none: hands at rest, trembling hands, motors at their peak."""

import mujoco
import numpy as np

from models.humanoid.skeleton import rest_pose
from models.phantom.parameters import PREMIUM_1_5
from models.world.scene import PHANTOM
from sim.loop.channels import make_logs
from sim.loop.servo import run_block
from sim.users.hand.actions import Grab
from sim.users.hand.arm import Arm
from sim.world.encoders import TOP_RATES
from sim.world.world import World
from tests.sim.bare_servos import START, bare_servo, device_world, follow_program, simulated
from tests.sim.loop.exchange_loop import ExchangeLoop


def test_motionless_hand_is_no_fault() -> None:
    """At rest without force, firmly against a small force, and, with the switch pressed, against a large one."""
    path = np.tile(START, (2, 1))
    cases = (
        (Arm(), follow_program(0.0, 0.0)),
        (Arm(1000.0, 10.0, path, 10.0), follow_program(1.0, 0.0)),
        (Arm(1000.0, 10.0, grabs=(Grab(0.0, (0.0, 0.0, 0.0), seconds=0.1, hold=3.0),)), follow_program(60.0, 0.0)),
    )
    motionless = []
    for arm, program in cases:
        world = device_world()
        servo = bare_servo(world, simulated(world, arm), program)
        ticks, frames = make_logs(servo, 3000)
        run_block(servo, 0, 3000, False, ticks, frames)
        assert not ticks.fault.any()
        motionless.append(np.all(np.diff(ticks.hand[-600:, 1:4], axis=0) == 0.0))
    assert all(motionless)  # so that frozen encoders could have been suspected


def test_trembling_firm_hand_under_force_is_no_fault() -> None:
    t = np.arange(3000) * 1e-3
    tremor = 0.05e-3 * np.sin(2.0 * np.pi * 9.0 * t)[:, None] * np.array([0.6, 0.64, 0.48])
    loop = ExchangeLoop(Arm(1000.0, 10.0, START + tremor, 1e-3))
    loop.run(2500)
    assert loop.sizes[-1] > 1.0
    assert not any(loop.fault)


def test_linkage_at_peak_torque_stays_below_the_impossible_rate() -> None:
    """Every motor at its peak torque from stop to stop, with friction, stays below the impossible rate."""
    world = World(kind="none")
    model, fastest = world.model, np.zeros(3)
    dofs = [int(model.joint(PHANTOM + name).dofadr[0]) for name in ("theta1", "theta2", "theta3")]
    for motor in range(3):
        for sign in (-1.0, 1.0):
            world.reset(START, rest_pose())
            peak = sign * np.array(PREMIUM_1_5.peak_torque) * (np.arange(3) == motor)
            for positions in (-peak, peak):
                world.data.ctrl[:3] = positions
                for _ in range(4000):
                    mujoco.mj_step(model, world.data)
                    fastest = np.maximum(fastest, np.abs(world.data.qvel[dofs]))
    assert np.all(fastest < TOP_RATES)
    assert np.all(fastest > 0.15 * np.array(TOP_RATES))
