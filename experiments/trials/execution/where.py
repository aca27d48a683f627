"""Where trials run, as commands and Python take it: on threads, in processes, or on a cluster."""

from typing import Annotated

from controllers.errors import ParameterError
from experiments.config.part import part, whole_number


@part
class Where:
    """Where trials run: one of three."""

    threads: Annotated[int | None, whole_number(1)] = None
    """Trials at a time in this process; by default as many as there are processors."""
    workers: Annotated[int | None, whole_number(1)] = None
    """Run them in so many processes of a local Dask cluster instead."""
    cluster: str | None = None
    """Run them on the workers of this Dask scheduler instead, such as tcp://host:8786."""

    def __post_init__(self) -> None:
        given = {"--threads": self.threads, "--workers": self.workers, "--cluster": self.cluster}
        chosen = [name for name, value in given.items() if value is not None]
        if len(chosen) > 1:
            raise ParameterError(f"{' and '.join(chosen)} contradict each other; expected one of them")
