"""Executor of trials on a Dask cluster: local processes or the workers of any scheduler."""

import logging
import socket
from collections.abc import Generator, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from experiments.config.part import from_json
from experiments.config.run_config import RunConfig
from experiments.trials.design.plan import trial_key
from experiments.trials.design.study_config import StudyError
from experiments.trials.trial.run_trial import Row, Task, perform_trial
from sim.hardware.process_start import blocked_sigint
from sim.recording.recorder import DiskFull

# tasks queued for each thread of a worker: one more than for local threads, to cover the network latency
TASKS_PER_THREAD = 3
# number of workers that die while running the same trial before the trial is taken to be the cause
MAX_WORKER_DEATHS = 50
MAX_START_ATTEMPTS = 5  # attempts to start a local cluster, as a worker may be killed while it starts
_LOCAL_TIMEOUT = "120s"  # timeout of local connections; processes on a busy machine may have to wait
_MAX_WAIT = "30s"  # timeout for a scheduler to answer, and for its first worker


class Cluster:
    """Runs trials on the workers of a scheduler, including workers that join later.

    If a worker is killed, Dask gives its trials to another one.

    Parameters
    ----------
    client : distributed.Client
        Client of the scheduler.
    where : str
        Name of the scheduler in messages.
    """

    def __init__(self, client: Any, where: str):
        self._client, self._scheduler = client, where

    def rows(self, tasks: Iterable[Task]) -> Iterator[Row]:
        """Yield rows of tasks as they are completed; tasks are drawn from the iterable as they are needed.

        Raises
        ------
        StudyError
            If the scheduler is lost, or the code or files of a worker differ from the driver's.
        """
        from distributed import as_completed

        pending, running = iter(tasks), as_completed()
        for task in _take(pending, TASKS_PER_THREAD * max(1, self._thread_count())):
            running.add(self._submit(task))
        for future in running:
            yield self._row(future)
            for task in _take(pending, 1 + max(0, TASKS_PER_THREAD * self._thread_count() - running.count() - 1)):
                running.add(self._submit(task))

    def _submit(self, task: Task) -> Any:
        # pure=False: a task may be submitted again after its future was released.
        return self._client.submit(perform_on_worker, task, key=f"trial-{task.key}", pure=False)

    def _row(self, future: Any) -> Row:
        from distributed import KilledWorker

        try:
            row = future.result()
        except (StudyError, DiskFull):
            raise
        except KilledWorker:
            key = str(future.key).removeprefix("trial-")
            return Row(key, "failed", f"every one of {MAX_WORKER_DEATHS} workers that ran it died", {}, 0.0, "", "")
        except (OSError, TimeoutError, RuntimeError) as error:
            raise self._scheduler_error(error) from None
        except Exception as error:  # whatever a worker could not import or unpickle
            if future.status in ("cancelled", "lost"):
                raise self._scheduler_error(error) from None
            raise StudyError(
                f"a worker of {self._scheduler}: {type(error).__name__}: {error}; expected this version of hvf there"
            ) from None
        finally:
            future.release()
        return Row(*row)

    def _scheduler_error(self, error: BaseException) -> StudyError:
        reason = (str(error).splitlines() or [type(error).__name__])[0].rpartition("reason: ")[2].rstrip(".")
        return StudyError(
            f"{self._scheduler}: the scheduler is lost ({reason}); every trial so far is kept; start it again to go on"
        )

    def _thread_count(self) -> int:
        try:
            return sum(self._client.nthreads().values())
        except (OSError, TimeoutError, RuntimeError, ValueError) as error:
            raise self._scheduler_error(error) from None


@contextmanager
def local_cluster(workers: int) -> Generator[Cluster]:
    """A cluster of `workers` local processes, each of which runs one trial at a time; closed after the block.

    Raises
    ------
    StudyError
        If it cannot be started.
    """
    distributed = _import_distributed()
    import dask

    settings = {
        "distributed.scheduler.allowed-failures": MAX_WORKER_DEATHS, "distributed.worker.memory.terminate": False,
        "distributed.comm.timeouts.connect": _LOCAL_TIMEOUT, "distributed.comm.timeouts.tcp": _LOCAL_TIMEOUT,
    }  # fmt: skip
    with dask.config.set(settings), ExitStack() as stack:  # pyright: ignore[reportPrivateImportUsage]
        with blocked_sigint():  # Ctrl-C in a terminal reaches all its processes: it is this one that ends the workers
            cluster = stack.enter_context(_start_processes(distributed, workers))
            client = stack.enter_context(distributed.Client(cluster))
        yield Cluster(client, f"{workers} local workers")


def _start_processes(distributed: Any, workers: int) -> Any:
    """Start Dask's local cluster, in several attempts, since Dask gives up if a worker dies while it starts."""
    reason = ""
    for _ in range(MAX_START_ATTEMPTS):
        try:
            return distributed.LocalCluster(
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=_LOG_LEVEL
            )
        except RuntimeError as error:
            reason = str(error.__cause__ or error).splitlines()[0]
    raise StudyError(f"{workers} local workers do not start ({reason}); expected fewer --workers, or --threads instead")


@contextmanager
def cluster_at(address: str) -> Generator[Cluster]:
    """The cluster of a running scheduler, given by its address such as ``tcp://host:8786``.

    Raises
    ------
    StudyError
        If no scheduler answers, or it has no workers.
    """
    distributed = _import_distributed()
    try:
        client = distributed.Client(address, timeout=_MAX_WAIT)
    except (OSError, TimeoutError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise StudyError(
            f"{address}: no Dask scheduler answers ({reason}); expected one such as tcp://host:8786"
        ) from None
    try:
        try:
            client.wait_for_workers(1, timeout=_MAX_WAIT)
        except TimeoutError:
            raise StudyError(
                f"{address}: the scheduler has no workers after {_MAX_WAIT}; start some with `dask worker {address}`"
            ) from None
        yield Cluster(client, address)
    finally:
        client.close(timeout="2s")


_LOG_LEVEL = logging.CRITICAL


def _import_distributed() -> Any:
    try:
        import distributed
    except ImportError:
        raise StudyError(
            "clusters need Dask; expected pip install 'haptic-vector-fields[study]', or --threads instead"
        ) from None
    for name in ("distributed", "distributed.client", "distributed.comm", "distributed.core", "distributed.batched"):
        logging.getLogger(name).setLevel(_LOG_LEVEL)
    return distributed


def perform_on_worker(task: Task) -> Row:
    """Run `perform_trial` on a worker, after checking that its code and files are those of the driver.

    Raises
    ------
    StudyError
        If they differ.
    """
    config = from_json(RunConfig, task.config, "a trial's configuration")
    try:
        key = trial_key(config)
    except StudyError as error:
        raise StudyError(f"worker on {socket.gethostname()}: {error}; copy it there, and start it again") from None
    if key != task.key:
        raise StudyError(
            f"worker on {socket.gethostname()}: its code, libraries, clips or maps differ from the driver's; expected "
            "the same version of all, and start it again"
        )
    return perform_trial(task)


def _take(tasks: Iterator[Task], number: int) -> Iterator[Task]:
    for _, task in zip(range(number), tasks, strict=False):
        yield task
