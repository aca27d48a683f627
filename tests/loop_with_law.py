"""A run with a user-defined field, in Python or composed, in place of its mode's field."""

from dataclasses import replace

from controllers.fields.algebra.law import Law
from controllers.safety.energy_tank import EnergyTank
from experiments.config.run_config import RunConfig
from experiments.setups.session import Session
from experiments.setups.wiring import wire
from sim.loop.loop import Loop, Observer


def loop_with(
    config: RunConfig, law: Law, observe: Observer = lambda ticks, frames, n: None, tank: EnergyTank | None = None
) -> tuple[Session, Loop]:
    """Session of a configuration with its field replaced, and the loop that runs it.

    Parameters
    ----------
    config : RunConfig
        Everything but the field: clips, hand, figure, device.
    law : Law
        The field; its laws in Python are called at every tick.
    observe : Observer
        What is done with each block of ticks.
    tank : EnergyTank, optional
        What the field may inject; by default as much as that of the configuration.

    Raises
    ------
    ModelError, ControllerError, SimError
        As `experiments.setups.wiring.wire`.
    """
    session, program = wire(config), law.program()
    field = session.servo.field.of(program)
    if tank is not None:
        field = field._replace(budget=tank.params(), tank=tank.fresh_memory())
    session = replace(session, servo=session.servo._replace(field=field))
    return session, Loop(session.servo, session.world, observe, python_laws=program.python_laws)
