"""Trials on a Dask cluster: processes of this machine, or workers anywhere; the same tasks, the same rows."""

import logging
import socket
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from experiments.config.part import from_json
from experiments.config.run_config import RunConfig
from experiments.trials.errors import StudyError
from experiments.trials.plan import key_of
from experiments.trials.run_trial import Row, Task, perform

AHEAD = 3  # tasks that wait for each thread of a worker: one more than a thread's, for the way there and back
DEATHS = 50  # of workers with the same trial on them, after which the trial is taken to be the cause
STARTS = 5  # of a local cluster, of which a worker may be killed before it is there
_BUSY = "120s"  # for what is on this machine: one that does much else may leave it waiting
_WAIT = "30s"  # for a scheduler, and for a first worker


class Cluster:
    """Runs trials on the workers of a scheduler, those that come later included.

    A worker that is killed costs the trials that were on it, which Dask gives to another one.

    Parameters
    ----------
    client : distributed.Client
        Of the scheduler.
    where : str
        The scheduler, for messages.
    """

    def __init__(self, client: Any, where: str):
        self._client, self._where = client, where

    def rows(self, tasks: Iterable[Task]) -> Iterator[Row]:
        """Rows of tasks, as they are done; tasks are asked for as they are needed.

        Raises
        ------
        StudyError
            If the scheduler is lost, or a worker has other code or other files.
        """
        from distributed import as_completed

        left, running = iter(tasks), as_completed()
        for task in _first(left, AHEAD * max(1, self._threads())):
            running.add(self._submit(task))
        for future in running:
            yield self._row(future)
            for task in _first(left, 1 + max(0, AHEAD * self._threads() - running.count() - 1)):
                running.add(self._submit(task))

    def _submit(self, task: Task) -> Any:
        # A trial is a function of its task, but not a pure one to Dask: a future that is gone may be asked for again.
        return self._client.submit(perform_on_worker, task, key=f"trial-{task.key}", pure=False)

    def _row(self, future: Any) -> Row:
        from distributed import KilledWorker

        try:
            row = future.result()
        except StudyError:
            raise
        except KilledWorker:
            key = str(future.key).removeprefix("trial-")
            return Row(key, "failed", f"every one of {DEATHS} workers that ran it died", {}, 0.0, "", "")
        except (OSError, TimeoutError, RuntimeError) as error:
            raise self._lost(error) from None
        except Exception as error:  # what a worker cannot import or unpack, Dask raises here as it is
            if future.status in ("cancelled", "lost"):
                raise self._lost(error) from None
            raise StudyError(
                f"a worker of {self._where}: {type(error).__name__}: {error}; expected this version of hvf there"
            ) from None
        finally:
            future.release()
        return Row(*row)

    def _lost(self, error: BaseException) -> StudyError:
        said = (str(error).splitlines() or [type(error).__name__])[0].rpartition("reason: ")[2].rstrip(".")
        return StudyError(
            f"{self._where}: the scheduler is lost ({said}); every trial so far is kept; start it again to go on"
        )

    def _threads(self) -> int:
        try:
            return sum(self._client.nthreads().values())
        except (OSError, TimeoutError, RuntimeError, ValueError) as error:
            raise self._lost(error) from None


@contextmanager
def local_cluster(workers: int) -> Generator[Cluster]:
    """A cluster of so many processes of this machine, a trial at a time each; it ends with the block.

    Raises
    ------
    StudyError
        If it cannot be started.
    """
    distributed = _distributed()
    import dask

    settings = {
        "distributed.scheduler.allowed-failures": DEATHS, "distributed.worker.memory.terminate": False,
        "distributed.comm.timeouts.connect": _BUSY, "distributed.comm.timeouts.tcp": _BUSY,
    }  # fmt: skip
    with (
        dask.config.set(settings),  # pyright: ignore[reportPrivateImportUsage]
        _processes(distributed, workers) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield Cluster(client, f"{workers} local workers")


def _processes(distributed: Any, workers: int) -> Any:
    """Dask's local cluster: of one whose worker dies while it starts, Dask gives up all, and so it is started again."""
    said = ""
    for _ in range(STARTS):
        try:
            return distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=_QUIET
            )
        except RuntimeError as error:
            said = str(error.__cause__ or error).splitlines()[0]
    raise StudyError(f"{workers} local workers do not start ({said}); expected fewer --workers, or --threads instead")


@contextmanager
def cluster_at(address: str) -> Generator[Cluster]:
    """The cluster of a scheduler that runs, such as ``tcp://host:8786``.

    Raises
    ------
    StudyError
        If nobody answers there, or it has no workers.
    """
    distributed = _distributed()
    try:
        client = distributed.Client(address, timeout=_WAIT)
    except (OSError, TimeoutError, ValueError) as error:
        said = str(error).splitlines()[0]
        raise StudyError(
            f"{address}: no Dask scheduler answers ({said}); expected one such as tcp://host:8786"
        ) from None
    try:
        try:
            client.wait_for_workers(1, timeout=_WAIT)
        except TimeoutError:
            raise StudyError(
                f"{address}: the scheduler has no workers after {_WAIT}; start some with `dask worker {address}`"
            ) from None
        yield Cluster(client, address)
    finally:
        client.close(timeout="2s")


_QUIET = logging.CRITICAL


def _distributed() -> Any:
    try:
        import distributed
    except ImportError:
        raise StudyError(
            "clusters need Dask; expected pip install 'haptic-vector-fields[study]', or --threads instead"
        ) from None
    for name in ("distributed", "distributed.client", "distributed.comm", "distributed.core", "distributed.batched"):
        logging.getLogger(name).setLevel(_QUIET)
    return distributed


def perform_on_worker(task: Task) -> Row:
    """`perform`, on a worker whose code and files are those of the driver.

    Raises
    ------
    StudyError
        If they are not.
    """
    config = from_json(RunConfig, task.config, "a trial's configuration")
    try:
        key = key_of(config)
    except StudyError as error:
        raise StudyError(f"worker on {socket.gethostname()}: {error}; copy it there, and start it again") from None
    if key != task.key:
        raise StudyError(
            f"worker on {socket.gethostname()}: its code, libraries, clips or maps differ from the driver's; expected "
            "the same version of all, and start it again"
        )
    return perform(task)


def _first(tasks: Iterator[Task], number: int) -> Iterator[Task]:
    for _, task in zip(range(number), tasks, strict=False):
        yield task
