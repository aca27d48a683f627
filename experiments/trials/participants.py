"""Who takes part in a study: people drawn from a population."""

from experiments.trials.study_config import Users
from sim.users.person import Person
from sim.users.population import population


def participants(users: Users) -> tuple[Person, ...]:
    """The people of a study, who depend on the seed of the population alone: more of them begin with the same ones."""
    return population(users.number, users.seed)
