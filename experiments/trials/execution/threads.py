"""Executor of trials on the threads of one process: the compiled loop releases the GIL, and maps are shared."""

from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

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
        OSError, MemoryError
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
