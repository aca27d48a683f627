"""Choice of the executor of trials: threads, local processes, or a cluster."""

import os
from collections.abc import Generator
from contextlib import contextmanager

from experiments.trials.execution.drive import Executor
from experiments.trials.execution.threads import Threads
from experiments.trials.execution.where import Where


@contextmanager
def executor(where: Where) -> Generator[Executor]:
    """The executor on threads of this process, local processes, or a scheduler's workers.

    Raises
    ------
    StudyError
        If the cluster cannot be reached or started.
    """
    if where.workers is None and where.cluster is None:
        yield Threads(where.threads or os.cpu_count() or 1)
        return
    from experiments.trials.execution.cluster import cluster_at, local_cluster  # Dask takes a second to import

    with local_cluster(where.workers) if where.workers is not None else cluster_at(where.cluster or "") as made:
        yield made
