"""``hvf live``: the page behind its gate, until Ctrl-C."""

import secrets
from dataclasses import replace
from pathlib import Path

from controllers.errors import ParameterError
from experiments.config.run_config import RunConfig
from experiments.live.gate import HERE, Gate
from experiments.live.page import Page
from experiments.live.run_panel import FOR_EVER
from sim.errors import SimError

LEAST_TOKEN = 16  # characters: none that can be guessed


def live(config: RunConfig, host: str, port: int, out: Path, given: str = "") -> None:
    """Serve the page of a run that is driven.

    Parameters
    ----------
    config : RunConfig
        What runs first.
    host, port
        To listen on; the next free port is taken if it is in use.
    out : Path
        Folder for takes and clips.
    given : str
        The token; by default a new one, where one is needed.

    Raises
    ------
    ParameterError
        If a token is too easily guessed, there is no figure to be shown, or the hand is somebody else's.
    SimError
        If the page cannot be served there, or the servo's process ends.
    """
    if config.figure.kind == "none":
        raise ParameterError("the live page shows a figure; expected --figure physical or kinematic")
    if config.user.does not in ("relaxed", "lead") or config.user.pushes or config.user.grabs:
        raise ParameterError("on the live page the hand is yours; leave out --user and what it does")
    token = token_for(host, given)
    if out.exists() and not out.is_dir():
        raise SimError(f"{out}: is a file; expected a folder for takes and clips")
    page = Page(replace(config, seconds=FOR_EVER), out, port=0)
    try:
        gate = Gate(host, port, page.port, token)
        try:
            print("\n".join(_lines(host, gate.port, out, token)), flush=True)
            page.serve()
        finally:
            gate.close()
    except KeyboardInterrupt:
        print(f"\nEnded; takes and clips are in {out}. hvf report {out}/takes/NAME draws a take.")
    finally:
        page.close()


def token_for(host: str, given: str) -> str | None:
    """The token of a page on a host: none where only this machine comes.

    Raises
    ------
    ParameterError
        If the one that is given can be guessed.
    """
    if host in HERE and not given:
        return None
    if given and (len(given) < LEAST_TOKEN or not given.isascii() or not given.isalnum()):
        raise ParameterError(f"--token is too easily guessed; expected {LEAST_TOKEN} letters and digits or more")
    return given or secrets.token_hex(16)


def _lines(host: str, port: int, out: Path, token: str | None) -> list[str]:
    if token is None:
        return [f"Open http://127.0.0.1:{port} and drag the orange ball; Ctrl-C ends.", f"Takes go to {out}."]
    return [
        f"Open http://{host}:{port}/?token={token} and drag the orange ball; Ctrl-C ends.",
        f"Takes go to {out}. The token goes over the network as it is: through one that is not yours, use ssh -L.",
    ]
