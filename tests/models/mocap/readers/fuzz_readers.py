"""Coverage-guided fuzzing of the readers: `python fuzz_readers.py -max_total_time=300` (libFuzzer's options).

Any exception but the project's own ends the run and leaves the input in a `crash-…` file. It starts from the tests'
seeds and from real files, where the folder of motion capture lies beside the project.
"""

import contextlib
import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["models"]):
    from models.errors import ModelError
    from models.mocap.library import load

from motion_files import AMC, ASF, BVH, CHARACTER, DEEPMIMIC

FOLDER = Path(tempfile.mkdtemp(prefix="fuzz-readers-"))
# The first byte of an input says what the rest is.
KINDS = {b"B": "m.bvh", b"S": "m.asf", b"A": "m.amc", b"C": "m_character.txt", b"D": "m_walk.txt"}
SEEDS = {b"B": BVH, b"S": ASF, b"A": AMC, b"C": CHARACTER, b"D": DEEPMIMIC}


def one_input(data: bytes) -> None:
    kind, content = data[:1], data[1:]
    if kind not in KINDS:
        return
    for other, name in KINDS.items():
        (FOLDER / name).write_bytes(content if other == kind else SEEDS[other].encode())
    motion = {b"S": "m.amc", b"C": "m_walk.txt"}.get(kind, KINDS[kind])
    with contextlib.suppress(ModelError):
        load(FOLDER / motion)


def corpus() -> Path:
    """A folder of seeds: one of each kind, and real files small enough to mutate quickly."""
    folder = FOLDER / "corpus"
    folder.mkdir()
    for kind, text in SEEDS.items():
        (folder / kind.decode()).write_bytes(kind + text.encode())
    real = Path(__file__).resolve().parents[4].parent / "shared" / "mocap"
    kinds = {".bvh": b"B", ".asf": b"S", ".txt": b"D"}
    for path in real.glob("**/*.*"):
        if path.suffix in kinds and path.parent.name != "licences" and path.stat().st_size < 50_000:
            (folder / f"{path.parent.name}-{path.name}").write_bytes(kinds[path.suffix] + path.read_bytes())
    return folder


if __name__ == "__main__":
    atheris.Setup([*sys.argv, "-max_len=60000", "-rss_limit_mb=2048", "-timeout=20", str(corpus())], one_input)
    atheris.Fuzz()
