"""The shared-memory board: a reader never sees a partial write."""

import pickle
import threading
import time

import numpy as np

from experiments.live.session.messages import Board

SIZES = {"a": 3, "b": 500}


def test_arrays_are_read_as_written_together():
    writer = Board(SIZES)
    reader = pickle.loads(pickle.dumps(writer))
    writer.write({"a": [1.0, 2.0, 3.0], "b": np.arange(500.0)})
    found = reader.read()
    np.testing.assert_array_equal(found["a"], [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(found["b"], np.arange(500.0))
    writer.write({"a": [9.0]})
    np.testing.assert_array_equal(reader.read()["a"], [9.0, 2.0, 3.0])
    found["a"][:] = 0.0  # a copy
    np.testing.assert_array_equal(reader.read()["a"], [9.0, 2.0, 3.0])
    reader.close()
    writer.close()


def test_reader_never_sees_a_partial_write():
    writer = Board(SIZES)
    reader = pickle.loads(pickle.dumps(writer))
    ended = threading.Event()

    def write() -> None:
        k = 0.0
        while not ended.is_set():
            k += 1.0
            writer.write({"a": np.full(3, k), "b": np.full(500, k)})
            time.sleep(1e-5)

    thread = threading.Thread(target=write)
    thread.start()
    try:
        for _ in range(300):
            found = reader.read()
            assert np.all(found["b"] == found["a"][0])
    finally:
        ended.set()
        thread.join()
        reader.close()
        writer.close()
