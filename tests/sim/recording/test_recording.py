"""Reading of recordings: damaged and foreign files are refused, missing channels are named."""

import json
import random
import subprocess
import sys
import time

import h5py
import pytest

from sim.recording.recorder import Recorder
from sim.recording.recording import Recording, RecordingError
from sim.recording.unclosed import lookup3
from tests.sim.recording.row_numbers import GROUPS, WRITER, block


def test_rows_beyond_the_row_count_are_not_read(tmp_path):
    path = tmp_path / "run.h5"
    with Recorder(path, {}, 1, GROUPS, {}) as recorder:
        recorder.append("ticks", block(0, 500))
    with h5py.File(path, "r+") as file:
        file["ticks/p"].resize(900, axis=0)
    with Recording(path) as recording:
        assert recording.groups["ticks"]["p"].shape == (500, 3)


@pytest.mark.parametrize(
    ("alter", "message"),
    [
        (lambda file: file["ticks/p"].resize(100, axis=0), r"ticks/p has 100 rows, ticks/rows says 500"),
        (lambda file: file["ticks/p"].resize(900, axis=0), r"ticks/p has 900 rows, ticks/rows says 500"),
        (lambda file: file["ticks/rows"].__setitem__(0, 501), r"ticks/\w+ has 500 rows, ticks/rows says 501"),
    ],
)
def test_complete_recording_with_inconsistent_channel_lengths_is_damaged(tmp_path, alter, message):
    path = tmp_path / "run.h5"
    with Recorder(path, {}, 1, GROUPS, {}) as recorder:
        recorder.append("ticks", block(0, 500))
        recorder.close({"rms": 0.1})
    with h5py.File(path, "r+") as file:
        alter(file)
    with pytest.raises(RecordingError, match=rf"run\.h5: not a recording, or damaged \({message}\); expected"):
        Recording(path)


def test_error_for_a_missing_channel_names_the_recorded_ones(tmp_path):
    with Recorder(tmp_path / "run.h5", {}, 1, GROUPS, {"curve": [1.0]}) as recorder:
        recorder.append("ticks", block(0, 5))
    with Recording(tmp_path / "run.h5") as recording:
        assert len(recording.channel("ticks", "p")) == 5
        assert recording.arrays["curve"] == [1.0]
        with pytest.raises(RecordingError, match=r"no channel ticks/q; there are \['applied', 'p', 't'\]"):
            recording.channel("ticks", "q")
        with pytest.raises(RecordingError, match=r"no group pings; there are \['frames', 'ticks'\]"):
            recording.channel("pings", "q")
        with pytest.raises(RecordingError, match=r"frames/t has no rows"):
            recording.channel("frames", "t")
        with pytest.raises(RecordingError, match=r"no array tube; there are \['curve'\]"):
            recording.arrays["tube"]
        with pytest.raises(RecordingError, match=r"no text title; there are \[\]"):
            recording.texts["title"]
        with pytest.raises(RecordingError, match=r"run\.h5: no array or text river; there are \['curve'\]"):
            recording.static["river"]
        with pytest.raises(RecordingError, match=r"run\.h5: no channel ticks/q; there are"):
            recording.groups["ticks"]["q"]


def recording_bytes(path, closed=True):
    """A recording of a second, closed or as a kill leaves it."""
    script = WRITER if closed else WRITER.replace("recorder.close", "import os; os._exit")
    subprocess.run([sys.executable, "-c", script, str(path), "1000"], stdout=subprocess.PIPE, check=False, timeout=60)
    return path.read_bytes()


def damaged(content):
    """Thirty bytes of a run cut somewhere, and thirty with bits turned over."""
    rng = random.Random(3)
    for _ in range(30):
        yield content[: rng.randrange(1, len(content))]
    for k in range(30):
        spoiled = bytearray(content)
        for _ in range(1 + k):
            spoiled[rng.randrange(len(spoiled) if k % 2 else 8000)] ^= 1 << rng.randrange(8)
        yield bytes(spoiled)


@pytest.mark.parametrize("closed", [True, False])
def test_truncated_or_corrupt_file_is_read_or_refused_without_hanging(tmp_path, closed):
    content = recording_bytes(tmp_path / "whole.h5", closed)
    refused, began = list[str](), time.perf_counter()
    for k, bytes_of in enumerate(damaged(content)):
        path = tmp_path / f"{k}.h5"
        path.write_bytes(bytes_of)
        try:
            with Recording(path) as recording:
                for channel in recording.groups["ticks"].values():
                    assert len(channel[:]) == len(channel)
        except RecordingError as error:
            refused.append(str(error))
    assert len(refused) > 30
    assert not [message for message in refused if "\n" in message]
    assert time.perf_counter() - began < 30.0  # HDF5 alone would hang


def test_error_for_a_truncated_file_names_both_sizes(tmp_path):
    content = recording_bytes(tmp_path / "run.h5")
    (tmp_path / "run.h5").write_bytes(content[:20000])
    with pytest.raises(RecordingError, match=rf"run\.h5: .*cut short: 20000 bytes of {len(content)}; expected"):
        Recording(tmp_path / "run.h5")


def test_lookup3_hash_equals_published_values():
    assert lookup3(b"Four score and seven years ago") == 0x17770551  # from lookup3.c itself
    assert lookup3(b"") == 0xDEADBEEF


def test_file_that_is_no_recording_is_refused_in_one_line(tmp_path):
    (tmp_path / "text.h5").write_text("no HDF5")
    with h5py.File(tmp_path / "other.h5", "w", libver="latest") as file:
        file["config"] = json.dumps({})
    for name in ("missing.h5", "text.h5", "other.h5"):
        with pytest.raises(RecordingError, match=rf"{name}: .*expected the run\.h5 of a run") as caught:
            Recording(tmp_path / name)
        assert "\n" not in str(caught.value)
