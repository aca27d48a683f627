"""``hvf live``: a run in the browser."""

from pathlib import Path
from typing import Annotated

from experiments.config.options import Options, config_of_options
from experiments.config.part import part, whole_number


@part
class Command:
    """Take the stylus with the mouse: a page in the browser on which a run is driven, bent, tuned and recorded."""

    options: Options  # pyright: ignore[reportInvalidTypeForm] - made of the parts
    """What is run."""
    port: Annotated[int, whole_number(0, 2**16)] = 8080
    """Port of the page; the next free one is used if it is taken."""
    host: str = "127.0.0.1"
    """Address to listen on; on any but this machine's own, the page asks for a token, which is printed."""
    out: Path = Path("runs/live")
    """Folder for takes and clips."""
    token: str = ""
    """The token, by default a new one."""

    def __call__(self) -> int:
        """Serve until Ctrl-C."""
        from experiments.live.command import live

        live(config_of_options(self.options), self.host, self.port, self.out, self.token)
        return 0
