"""The result of a simulation: summary, recorded channels, animation and page, in a temporary or a given folder."""

import shutil
import tempfile
import time
import weakref
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

from rich.console import Console

from controllers.checks import check_kind
from experiments.config.keywords import to_keywords, with_keyword_messages
from experiments.config.part import to_json
from experiments.config.run_config import RunConfig
from experiments.files.given_path import given_path
from experiments.results.folder import CONFIG, EDITED, RECORDING, REPORT, claimed_and_cleared
from experiments.results.measures.summary import RunSummary
from experiments.runs.run import record as record_session
from experiments.runs.run import write_animations, write_summary
from experiments.setups.session import Session
from geometry.arrays import Array
from geometry.whole_files import atomic_file, write_text
from models.mocap.library import check_target
from sim.errors import SimError
from sim.recording.recording import Recording


def check_record(record: str | Path | None, overwrite: bool) -> None:
    """Refuse arguments of `Run.of` that have a wrong type, before anything is compiled."""
    if record is not None:
        given_path("record", record)
    check_kind("overwrite", overwrite, bool)


class NoChannel(SimError, KeyError):
    """A run has no channel of that name; a `KeyError` too, as of any mapping, so that ``in`` and ``get`` work."""

    __str__ = Exception.__str__  # that of KeyError puts the message in quotes


class Channels(Mapping[str, Array]):
    """Channels of a run at one rate, by name: ``run.ticks["force"]``, shape (n, ...)."""

    def __init__(self, run: "Run", group: str):
        self._run, self._group = run, group  # keeps the run, as a temporary folder is deleted with it

    def __getitem__(self, name: str) -> Array:
        with Recording(self._run.folder / RECORDING) as recording:
            if name not in recording.groups[self._group]:
                known = ", ".join(sorted(recording.groups[self._group]))
                raise NoChannel(f"no channel {name!r}; {self._group} has {known}")
            return recording.channel(self._group, name)[:]

    def __iter__(self) -> Iterator[str]:
        with Recording(self._run.folder / RECORDING) as recording:
            return iter(sorted(recording.groups[self._group]))

    def __len__(self) -> int:
        return len(list(iter(self)))

    def __repr__(self) -> str:
        return f"<{self._group}: {', '.join(self)}>"


@dataclass(frozen=True, eq=False)
class Run:
    """Result of a simulation.

    Attributes
    ----------
    folder : Path
        Folder of the recording; unless ``record`` was given, a temporary one that is deleted with the last reference to
        the run or its channels.
    summary : RunSummary
        Measures as numbers; `str` of a run gives them in words.
    remarks : tuple of str
        Remarks before the run: what its clips and its map are not suited for, and what was chosen instead. `str` has
        them first.
    """

    folder: Path
    summary: RunSummary
    _session: Session = field(repr=False)

    @staticmethod
    def of(
        session: Session, config: Mapping[str, object], seconds: float, record: str | Path | None, overwrite: bool
    ) -> "Run":
        """Run a session and keep its recording; see `Simulation.run`."""
        started, console = time.perf_counter(), Console(stderr=True, quiet=True)
        if record is None:
            folder = Path(tempfile.mkdtemp(prefix="hvf-"))
            try:
                summary = record_session(session, folder, config, seconds, started, console)
            except BaseException:
                shutil.rmtree(folder, ignore_errors=True)
                raise
            run = Run(folder, summary, session)
            weakref.finalize(run, shutil.rmtree, folder, ignore_errors=True)
            return run
        folder = Path(record)
        with claimed_and_cleared(folder, overwrite, session.config.device):
            summary = record_session(session, folder, config, seconds, started, console)
            write_animations(folder, session)
            if isinstance(session.config, RunConfig):
                write_text(folder / CONFIG, to_json(session.config))
            write_summary(folder, summary)
            run = Run(folder.absolute(), summary, session)  # wherever the program goes
            run.report()
        return run

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks before the run."""
        return tuple(map(to_keywords, self._session.remarks))

    @property
    def ticks(self) -> Channels:
        """Channels at the rate of the servo."""
        return Channels(self, "ticks")

    @property
    def frames(self) -> Channels:
        """Channels at the rate of the figure's control."""
        return Channels(self, "frames")

    @with_keyword_messages(overwrite="overwrite=True")
    def to_bvh(self, path: str | Path, overwrite: bool = False) -> Path:
        """Write the animation as the hand made it.

        Raises
        ------
        ModelError
            If the name does not end in .bvh, or the file exists and is not to be overwritten.
        SimError
            If the run has no figure.
        """
        target = given_path("path", path)
        check_kind("overwrite", overwrite, bool)
        if not self._session.world.has_figure:
            raise SimError("the run has no figure, and so no animation; expected a run of a figure")
        check_target(target, overwrite)
        if not (self.folder / EDITED).exists():
            write_animations(self.folder, self._session)
        target.parent.mkdir(parents=True, exist_ok=True)
        with (self.folder / EDITED).open("rb") as edited, atomic_file(target) as file:
            shutil.copyfileobj(edited, file)
        return target

    def report(self) -> Path:
        """Draw page and figures of the run; returns the page."""
        from experiments.results.pages.report import write_report_of  # matplotlib takes long to import

        write_report_of(self.folder)
        return self.folder / REPORT

    def frame(self) -> Any:
        """The ticks as a pandas DataFrame (pandas must be installed), with one column per scalar."""
        pandas = import_module("pandas")
        columns: dict[str, Any] = {}
        for name, values in self.ticks.items():
            rows = values.reshape(len(values), -1)
            suffixes = [""] if values.ndim == 1 else [f"_{i}" for i in range(rows.shape[1])]
            columns |= {name + suffix: rows[:, i] for i, suffix in enumerate(suffixes)}
        return pandas.DataFrame(columns).set_index("t")

    def __reduce__(self) -> str:
        raise SimError(
            "a run holds what is compiled in this process, and is not pickled; expected its summary, "
            "arrays of its channels, or the folder that record says"
        )

    def __str__(self) -> str:
        return "\n".join([*self.remarks, *self.summary.lines()])

    def __repr__(self) -> str:
        alone = self.summary.path.deviation_rms_mm
        deviation = "" if alone is None else f", {alone:.2f} mm RMS from the curve"
        return f"<run of {self.ticks['t'][-1]:.1f} s{deviation}>"

    def _repr_html_(self) -> str:
        """The replay, in a notebook."""
        page = self.report().read_text(encoding="utf-8").replace("&", "&amp;").replace('"', "&quot;")
        return f'<iframe srcdoc="{page}" width="100%" height="640"></iframe>'
