"""Scenes that no browser is connected to: a server for them, and the HTML page that replays one."""

import contextlib
import io
from collections.abc import Generator

import viser
from viser.infra import StateSerializer

# The only notification that a replay can show is that the browser renders in software.
_HEAD = "<style>.mantine-Notifications-root {display: none}</style>"


@contextlib.contextmanager
def unserved() -> Generator[viser.ViserServer]:
    """A server for a scene alone. Outside of `atomic`, waking it for each message takes as long as the rest."""
    quiet = io.StringIO()  # viser prints its address and its shutdown, which are irrelevant here
    with contextlib.redirect_stdout(quiet):
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        yield server
    finally:
        with contextlib.redirect_stdout(quiet):
            server.stop()


def page_of(scene: StateSerializer) -> str:
    """A self-contained HTML document that plays the messages of a scene."""
    return scene.as_html().replace("</head>", _HEAD + "</head>", 1)
