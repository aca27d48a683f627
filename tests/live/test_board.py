"""The shared-memory board of named rows."""

import pickle

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
