"""``hvf live``: the page behind its gate, until Ctrl-C."""

import secrets
from dataclasses import replace

from controllers.errors import ParameterError
from experiments.config.words import config_of_options
from experiments.live.gate import HERE, Gate
from experiments.live.live_options import Live
from experiments.live.page import Page
from experiments.live.run_panel import FOR_EVER
from sim.errors import SimError

LEAST_TOKEN = 16  # characters: none that can be guessed


def live(told: Live) -> None:
    """Serve the page.

    Raises
    ------
    ParameterError
        If a token is too short, or there is none to be had.
    SimError
        If the page cannot be served there, or the servo's process ends.
    """
    config = replace(config_of_options(told.options), seconds=FOR_EVER)
    if config.figure.kind == "none":
        raise ParameterError("the live page shows a figure; expected --figure physical or kinematic")
    token = token_for(told.host, told.token)
    if told.out.exists() and not told.out.is_dir():
        raise SimError(f"{told.out}: is a file; expected a folder for takes and clips")
    page = Page(config, told.out, port=0)
    try:
        gate = Gate(told.host, told.port, page.port, token)
        try:
            print("\n".join(_lines(told, gate.port, token)), flush=True)
            page.serve()
        finally:
            gate.close()
    except KeyboardInterrupt:
        print(f"\nEnded; takes and clips are in {told.out}. hvf report {told.out}/takes/NAME draws a take.")
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


def _lines(told: Live, port: int, token: str | None) -> list[str]:
    if token is None:
        return [f"Open http://127.0.0.1:{port} and drag the orange ball; Ctrl-C ends.", f"Takes go to {told.out}."]
    return [
        f"Open http://{told.host}:{port}/?token={token} and drag the orange ball; Ctrl-C ends.",
        f"Takes go to {told.out}. The token goes over the network as it is: through one that is not yours, use ssh -L.",
    ]
