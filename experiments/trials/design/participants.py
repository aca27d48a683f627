"""Participants of a study: people drawn from a population."""

from experiments.trials.design.study_config import Users
from sim.users.person.person import Person
from sim.users.person.population import population


def participants(users: Users) -> tuple[Person, ...]:
    """The people of a study; they depend on the population's seed alone, and a larger number only adds people."""
    return population(users.number, users.seed)
