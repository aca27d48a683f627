"""Memory shared by processes: no partial values, and a ring that counts the rows it lost."""

import multiprocessing
import pickle
import threading
from collections.abc import Iterator

import numpy as np
import pytest

from sim.hardware.shared import Ring, SharedNumbers


@pytest.fixture
def numbers() -> Iterator[SharedNumbers]:
    shared = SharedNumbers(64)
    yield shared
    shared.close()


@pytest.fixture
def ring() -> Iterator[Ring]:
    shared = Ring(8, 2)
    yield shared
    shared.close()


def test_reader_never_sees_a_partial_write(numbers: SharedNumbers) -> None:
    other, stop, seen = pickle.loads(pickle.dumps(numbers)), threading.Event(), np.zeros(64)
    numbers.write(seen)  # compile before anybody reads

    def write() -> None:
        k = 0
        while not stop.is_set():
            k += 1
            numbers.write(np.full(64, float(k)))

    thread = threading.Thread(target=write)
    thread.start()
    try:
        values = set()
        for _ in range(20000):
            if other.read(seen):
                assert (seen == seen[0]).all()
                values.add(seen[0])
    finally:
        stop.set()
        thread.join()
    other.close()
    assert len(values) > 1


def test_write_of_a_killed_writer_is_not_read(numbers: SharedNumbers) -> None:
    into = np.zeros(64)
    assert numbers.read(into)
    numbers.count[0] += 1
    assert not numbers.read(into)


def test_ring_returns_every_row_once_in_order(ring: Ring) -> None:
    for k in range(5):
        ring.append(np.array([k, -k]))
    rows, lost = ring.take()
    np.testing.assert_array_equal(rows[:, 0], range(5))
    assert lost == 0
    ring.append(np.array([5.0, 0.0]))
    rows, lost = ring.take()
    np.testing.assert_array_equal(rows[:, 0], [5])
    assert (len(ring.take()[0]), lost) == (0, 0)


def test_ring_overflow_counts_lost_rows(ring: Ring) -> None:
    for k in range(30):
        ring.append(np.array([k, 0.0]))
    rows, lost = ring.take()
    np.testing.assert_array_equal(rows[:, 0], range(23, 30))  # one slot is reserved for the next row
    assert lost == 23
    ring.append(np.array([30.0, 0.0]))
    rows, lost = ring.take()
    assert (rows[0, 0], lost) == (30.0, 0)


def test_process_that_ends_without_closing_writes_nothing_to_stderr(numbers, ring, capfd) -> None:
    child = multiprocessing.get_context("spawn").Process(target=len, args=((numbers, ring),))
    child.start()
    child.join()
    assert child.exitcode == 0
    assert capfd.readouterr().err == ""


def test_rows_overwritten_during_take_are_counted_and_not_returned(ring: Ring) -> None:
    for k in range(7):
        ring.append(np.array([k, 0.0]))
    copied = ring.numbers

    class Overtaken:
        def __getitem__(self, index):
            taken, ring.numbers = copied[index], copied
            for k in range(7, 11):
                ring.append(np.array([k, 0.0]))
            return taken

    ring.numbers = Overtaken()
    rows, lost = ring.take()
    np.testing.assert_array_equal(rows[:, 0], [4, 5, 6])
    assert lost == 4
    rows, lost = ring.take()
    np.testing.assert_array_equal(rows[:, 0], [7, 8, 9, 10])
    assert lost == 0
