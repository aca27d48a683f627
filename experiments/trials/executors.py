"""Where trials run: on threads, in processes, or on a cluster, as is asked for."""

import os
from collections.abc import Generator
from contextlib import contextmanager

from experiments.trials.drive import Executor
from experiments.trials.errors import StudyError
from experiments.trials.threads import Threads


@contextmanager
def executor(threads: int | None, workers: int | None, cluster: str | None) -> Generator[Executor]:
    """Threads of this process, processes of this machine, or a scheduler's workers.

    Raises
    ------
    StudyError
        If more than one is asked for, or less than one thread or worker.
    """
    given = {"--threads": threads, "--workers": workers, "--cluster": cluster}
    chosen = [name for name, value in given.items() if value is not None]
    if len(chosen) > 1:
        raise StudyError(f"{' and '.join(chosen)} contradict each other; expected one of them")
    for name in chosen:
        number = given[name]
        if isinstance(number, int) and number < 1:
            raise StudyError(f"{name} {number}: expected 1 or more")
    if workers is None and cluster is None:
        yield Threads(threads or os.cpu_count() or 1)
        return
    from experiments.trials.cluster import cluster_at, local_cluster  # Dask takes a second to import

    if workers is not None:
        with local_cluster(workers) as made:
            yield made
    elif cluster is not None:
        with cluster_at(cluster) as made:
            yield made
