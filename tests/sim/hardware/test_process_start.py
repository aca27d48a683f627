"""Ctrl-C does not reach the processes of a run from their start on."""

import multiprocessing
import signal

from sim.hardware.process_start import start_without_sigint


def report_blocked(answer) -> None:
    answer.send(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ()))


def test_process_starts_with_sigint_blocked_and_parent_keeps_it_unblocked() -> None:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=report_blocked, args=(theirs,), daemon=True)
    start_without_sigint(process)
    theirs.close()
    assert ours.recv()
    process.join()
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
