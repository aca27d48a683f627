"""Who takes part in a study: from a population to the user of each run."""

from experiments.trials.study_config import Users, Words


def participants(users: Users) -> tuple[Words, ...]:
    """What each of the users is in a run, in its words; who they are depends on the seed of the population alone."""
    return tuple({"user": users.does} for _ in range(users.number))
