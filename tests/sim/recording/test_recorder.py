"""A recording keeps all data, also of a killed run, and never overwrites another."""

import random
import re
import shutil
import subprocess
import sys
import time

import numpy as np
import pytest

from sim.recording.recorder import CHUNK_SECONDS, PAGE_SIZE, DiskFull, Group, Recorder
from sim.recording.recording import Recording, RecordingError
from tests.sim.recording.row_numbers import GROUPS, WRITER, block, holds_row_numbers


def test_everything_written_is_read_back_bit_for_bit(tmp_path):
    rng = np.random.default_rng(1)
    t, p, applied = rng.normal(size=777), rng.normal(size=(777, 3)), rng.normal(size=(777, 2, 3))
    curve = rng.normal(size=(50, 3))
    with Recorder(tmp_path / "run.h5", {"gain": 0.1}, 7, GROUPS, {"curve": curve, "xml": "<mujoco/> φ"}) as recorder:
        for a, b in ((0, 1), (1, 250), (250, 251), (251, 777)):
            recorder.append("ticks", {"t": t[a:b], "p": p[a:b], "applied": applied[a:b]})
        recorder.close({"rms": 0.1 + 0.2})
    with Recording(tmp_path / "run.h5") as recording:
        ticks = recording.groups["ticks"]
        assert np.array_equal(ticks["t"][:], t)
        assert np.array_equal(ticks["p"][:], p)
        assert np.array_equal(ticks["applied"][:], applied)
        assert np.array_equal(ticks["p"][10:500:7], p[10:500:7])
        assert np.array_equal(ticks["p"][-1], p[-1])
        assert ticks["p"].shape == (777, 3)
        assert len(recording.groups["frames"]["t"]) == 0
        assert recording.rates == {"ticks": 1000.0, "frames": 100.0}
        assert np.array_equal(recording.arrays["curve"], curve)
        assert recording.texts["xml"] == "<mujoco/> φ"
        assert (recording.config, recording.seed) == ({"gain": 0.1}, 7)
        assert recording.summary == {"rms": 0.1 + 0.2}
        assert recording.complete
        assert recording.versions["numpy"] == np.__version__
        with pytest.raises(IndexError):
            ticks["p"][777]


@pytest.mark.parametrize("seed", range(3))
def test_killed_run_opens_and_has_lost_less_than_a_second(tmp_path, seed):
    path = tmp_path / "run.h5"
    with subprocess.Popen([sys.executable, "-c", WRITER, str(path), "-1"], stdout=subprocess.PIPE) as writer:
        assert writer.stdout is not None
        writer.stdout.readline()
        time.sleep(random.Random(seed).uniform(0.0, 0.3))
        writer.kill()
        message = [20, *map(int, writer.stdout.read().split(b"\n")[:-1])][-1]
    with Recording(path) as recording:
        ticks = recording.groups["ticks"]
        assert message - len(ticks["t"]) <= CHUNK_SECONDS * 1000 <= 1000
        assert all(holds_row_numbers(channel) for channel in ticks.values())
        assert not recording.complete


# Kills a writer N times between the appearance of its file and its closing, and reads each file in a separate process,
# since HDF5 hangs on a torn structure.
KILLER = """
import os, random, signal, sys, time
from pathlib import Path
import numpy as np
from sim.recording.recorder import Group, Recorder
from sim.recording.recording import Recording
channels = {"t": (), "p": (3,), "applied": (2, 3), "q": (4,), "v": (3,), "ctrl": (54,)}
rng, path, lost = random.Random(0), Path(sys.argv[1]) / "run.h5", 0
def numbers(start, shape):
    rows = np.arange(start, start + 500.0)
    return np.broadcast_to(rows.reshape(-1, *[1] * len(shape)), (500, *shape))
for i in range(int(sys.argv[2])):
    path.unlink(missing_ok=True)
    writer = os.fork()
    if writer == 0:
        recorder = Recorder(path, {}, 1, {"ticks": Group(1000.0, channels)}, {"xml": "x" * 30000})
        for n in range(0, 100_000, 500):
            recorder.append("ticks", {name: numbers(n, shape) for name, shape in channels.items()})
        recorder.close({"text": "y" * 20000})
        os._exit(0)
    while not path.exists():
        time.sleep(0.0002)
    time.sleep(rng.uniform(0, rng.choice((0.01, 0.05, 0.2))))
    os.kill(writer, signal.SIGKILL)
    os.waitpid(writer, 0)
    reader = os.fork()
    if reader == 0:
        signal.alarm(20)
        with Recording(path) as recording:
            assert recording.summary in (None, {"text": "y" * 20000})
            for channel in recording.groups["ticks"].values():
                rows = channel[:]
                assert np.all(rows == np.arange(len(rows)).reshape(-1, *[1] * (rows.ndim - 1)))
        os._exit(0)
    lost += os.waitpid(reader, 0)[1] != 0
print(lost)
"""


@pytest.mark.slow
def test_kill_at_any_moment_leaves_a_readable_recording(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", KILLER, str(tmp_path), "150"], capture_output=True, check=True, text=True, timeout=300
    )
    assert done.stdout.split() == ["0"]


def test_hdf5_structures_do_not_cross_pages(tmp_path):
    """A write that crosses a page can be torn by a kill; the signatures of HDF5's structures show where they begin."""
    sizes = {b"OHDR": 130, b"EAHD": 70, b"EAIB": 100, b"EADB": 150}
    with Recorder(tmp_path / "run.h5", {}, 1, GROUPS, {"xml": "x" * 30000}) as recorder:
        for start in range(0, 100_000, 500):
            recorder.append("ticks", block(start, 500))
    content = (tmp_path / "run.h5").read_bytes()
    begins = [(match.start(), sizes[match[0]]) for match in re.finditer(b"OHDR|EAHD|EAIB|EADB", content)]
    assert len(begins) > 40
    assert all(begin // PAGE_SIZE == (begin + size) // PAGE_SIZE for begin, size in begins)


def test_exception_keeps_all_rows_and_marks_the_recording_incomplete(tmp_path):
    def run():
        with Recorder(tmp_path / "run.h5", {}, 1, GROUPS, {}) as recorder:
            recorder.append("ticks", block(0, 333))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run()
    with Recording(tmp_path / "run.h5") as recording:
        assert len(recording.groups["ticks"]["t"]) == 333
        assert recording.summary is None


def test_running_recording_is_readable(tmp_path):
    with Recorder(tmp_path / "run.h5", {}, 1, GROUPS, {}) as recorder:
        recorder.append("ticks", block(0, 600))
        with Recording(tmp_path / "run.h5") as recording:
            assert len(recording.groups["ticks"]["p"]) == 500
            assert holds_row_numbers(recording.groups["ticks"]["p"])


def test_rows_can_be_flushed_at_any_moment(tmp_path):
    with Recorder(tmp_path / "run.h5", {}, 1, GROUPS, {}) as recorder:
        start = 0
        for n in (70, 430, 1, 999, 250, 250):
            recorder.append("ticks", block(start, n))
            recorder.flush()
            start += n
            with Recording(tmp_path / "run.h5") as recording:
                ticks = recording.groups["ticks"]
                assert len(ticks["t"]) == start
                assert all(holds_row_numbers(channel) for channel in ticks.values())


@pytest.mark.slow
def test_memory_does_not_grow_with_the_run(tmp_path):
    """Fifty times as many rows cost a few megabytes more, not the hundred that they occupy."""
    script = """
import sys
from pathlib import Path
import numpy as np
from sim.loop.loop import peak_memory_mb
from sim.recording.recorder import Group, Recorder
n = 250
with Recorder(Path(sys.argv[1]), {}, 1, {"ticks": Group(1000.0, {"x": (100,)})}, {}) as recorder:
    for i in range(530):
        if i == 10:
            early = peak_memory_mb()
        recorder.append("ticks", {"x": np.full((n, 100), float(i))})
print(peak_memory_mb() - early)
"""
    result = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "run.h5")], capture_output=True, check=True, text=True
    )
    assert (tmp_path / "run.h5").stat().st_size > 100e6
    assert float(result.stdout) < 10.0


def test_existing_file_is_refused_and_left_alone(tmp_path):
    (tmp_path / "run.h5").write_text("precious")
    with pytest.raises(RecordingError, match=r"run\.h5: exists"):
        Recorder(tmp_path / "run.h5", {}, 1, GROUPS, {})
    assert (tmp_path / "run.h5").read_text() == "precious"
    assert [file.name for file in tmp_path.iterdir()] == ["run.h5"]


def test_failed_header_leaves_no_file(tmp_path):
    with pytest.raises(TypeError):
        Recorder(tmp_path / "run.h5", {"gain": object()}, 1, GROUPS, {})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("group", "change", "message"),
    [
        ("pings", {}, r"pings: no such group; there are \['frames', 'ticks'\]"),
        ("ticks", {"q": np.zeros(5)}, r"channels are .*'q'.*; expected"),
        ("ticks", {"p": np.zeros((5, 4))}, r"/ticks/p: shape is \(5, 4\); expected \(5, 3\)"),
        ("ticks", {"applied": np.zeros((4, 2, 3))}, r"/ticks/applied: shape is \(4, 2, 3\); expected \(5, 2, 3\)"),
    ],
)
def test_blocks_of_an_undeclared_shape_are_refused(tmp_path, group, change, message):
    with Recorder(tmp_path / "run.h5", {}, 1, GROUPS, {}) as recorder, pytest.raises(RecordingError, match=message):
        recorder.append(group, block(0, 5) | change)


@pytest.mark.parametrize(("rate", "channels"), [(0.0, {"t": ()}), (np.nan, {"t": ()}), (1.0, {}), (1.0, {"rows": ()})])
def test_group_without_rate_or_channels_is_refused(rate, channels):
    with pytest.raises(RecordingError):
        Group(rate, channels)


def test_full_disk_ends_the_run_with_one_line_and_keeps_recorded_rows(tmp_path, monkeypatch):
    free_bytes = [10e6]

    def usage(path):
        return shutil._ntuple_diskusage(int(10e6), 0, int(free_bytes[0]))

    monkeypatch.setattr(shutil, "disk_usage", usage)

    def run():
        with Recorder(tmp_path / "run.h5", {}, 1, GROUPS, {}) as recorder:
            for start in range(0, 4000, 500):
                free_bytes[0] = 10e6 - 2e6 * (start // 500)
                recorder.append("ticks", block(start, 500))

    with pytest.raises(
        DiskFull, match=r"run\.h5: the disk is full \(4 MB free\); what was recorded until then is kept"
    ):
        run()
    with Recording(tmp_path / "run.h5") as recording:
        assert len(recording.channel("ticks", "t")) == 1500
        assert all(holds_row_numbers(channel) for channel in recording.groups["ticks"].values())


QUOTA = """
import resource, sys
from pathlib import Path
import numpy as np
from sim.recording.recorder import DiskFull, Group, Recorder
resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, 1_000_000))
try:
    with Recorder(Path(sys.argv[1]), {}, 1, {"ticks": Group(1000.0, {"x": (50,)})}, {}) as recorder:
        for n in range(0, 10**5, 500):
            recorder.append("ticks", {"x": np.broadcast_to(np.arange(n, n + 500.0)[:, None], (500, 50))})
except DiskFull as error:
    print(error)
"""


def test_file_size_limit_ends_the_run_with_one_line_and_keeps_recorded_rows(tmp_path):
    """A limit that is not visible as free space is met while HDF5 writes."""
    done = subprocess.run(
        [sys.executable, "-c", QUOTA, str(tmp_path / "run.h5")], capture_output=True, text=True, timeout=60, check=True
    )
    assert "cannot be written any further (File too large); what was recorded until then is kept" in done.stdout
    assert done.stderr == ""
    with Recording(tmp_path / "run.h5") as recording:
        rows = recording.channel("ticks", "x")
        assert len(rows) >= 500
        assert holds_row_numbers(rows)
