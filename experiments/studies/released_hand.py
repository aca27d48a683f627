"""A hand on the simulated Phantom of a run, released at rest in a field other than the run's own."""

from controllers.fields.algebra.law import Program
from experiments.setups.session import Session
from experiments.trials.trial.measures import TrialLog
from geometry.arrays import Array
from models.humanoid.skeleton import rest_pose
from sim.devices.simulated import SimulatedPhantom
from sim.loop.loop import Loop
from sim.users.hand.arm import Arm
from sim.world.phantom_port import sense_in_motion


def released(session: Session, program: Program, start: Array, arm: Arm, seconds: float) -> dict[str, Array]:
    """Channels of the ticks of `TrialLog`, of a hand that is released at a place of H [m], shape (3,), in a field."""
    session.world.reset(start, rest_pose())
    phantom = session.servo.device
    assert isinstance(phantom, SimulatedPhantom)
    sense_in_motion(phantom.port)  # at zero velocity, as the hand begins at rest
    servo = session.servo._replace(field=session.servo.field.of(program), device=phantom.held_by(arm))
    log = TrialLog(servo, session.world)
    Loop(servo, session.world, log).run(seconds)
    return log.ticks
