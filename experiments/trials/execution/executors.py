"""Executors of trials: threads of this process, which share maps, local processes, or a cluster."""

import os
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager

from experiments.trials.design.study_config import Where
from experiments.trials.execution.drive import Executor
from experiments.trials.trial.run_trial import Row, Task, perform_trial

TASKS_PER_THREAD = 2  # tasks queued for each thread, so that none is idle; more would only take memory


class Threads:
    """Runs trials in parallel.

    Parameters
    ----------
    number : int
        Number of simultaneous trials.
    """

    def __init__(self, number: int):
        self._number = number

    def rows(self, tasks: Iterable[Task]) -> Iterator[Row]:
        """Yield rows of tasks as they are completed; tasks are drawn from the iterable as they are needed.

        Raises
        ------
        OSError, MemoryError, DiskFull
            If the machine lacks something.
        """
        pool, waiting = ThreadPoolExecutor(self._number), set[Future[Row]]()
        try:
            for task in tasks:
                waiting.add(pool.submit(perform_trial, task))
                if len(waiting) >= TASKS_PER_THREAD * self._number:
                    done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                    yield from (future.result() for future in done)
            while waiting:
                done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                yield from (future.result() for future in done)
        finally:
            pool.shutdown(cancel_futures=True)


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

    with local_cluster(where.workers) if where.workers is not None else cluster_at(where.cluster or "") as executor:
        yield executor
