"""Who takes part in a study: from a population to the user of each run."""

from experiments.trials.study_config import Users, Words
from sim.users.population import population


def participants(users: Users) -> tuple[Words, ...]:
    """What each of the users is in a run, in its words.

    Who they are depends on the seed of the population alone: the first ones of a larger number are the same people.
    """
    return tuple({"user": users.does, "person": person} for person in population(users.number, users.seed))
