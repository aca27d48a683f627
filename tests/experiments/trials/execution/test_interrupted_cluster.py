"""Ctrl-C in a terminal reaches all processes of a study: the workers leave it to the one that ends them."""

import signal
from contextlib import nullcontext

import pytest

from experiments.trials.execution import cluster

distributed = pytest.importorskip("distributed")


def test_workers_of_a_local_cluster_start_with_sigint_blocked(monkeypatch: pytest.MonkeyPatch) -> None:
    def is_blocked() -> bool:
        return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())

    def start(*_: object) -> nullcontext[None]:
        assert is_blocked()
        return nullcontext()

    monkeypatch.setattr(cluster, "_start_processes", start)
    monkeypatch.setattr(distributed, "Client", start)
    with cluster.local_cluster(2):
        assert not is_blocked()
