"""``hvf live``: serves the live page behind its access gate until Ctrl-C."""

import secrets
from dataclasses import replace
from pathlib import Path

from controllers.errors import ParameterError
from experiments.config.maps import MapFile
from experiments.config.run_config import RunConfig, phantom_of
from experiments.files.map_files import load_figure_map
from experiments.live.access_gate import LOCAL_HOSTS, AccessGate
from experiments.live.page import Page
from experiments.live.panels.run_panel import MAX_SESSION_DURATION
from experiments.setups.parts.clips import load_clips
from sim.errors import SimError

LEAST_TOKEN = 16  # [characters] shortest token that may be given, so that it cannot be guessed


def live(config: RunConfig, host: str, port: int, out: Path, given: str) -> None:
    """Serve the live page of a run that a person drives.

    Parameters
    ----------
    config : RunConfig
        Configuration of the first run.
    host, port
        Address to listen on; if the port is in use, the next free one is taken.
    out : Path
        Folder for takes and clips.
    given : str
        Token of the page's address; if empty, a new one is generated where the host needs one.

    Raises
    ------
    ParameterError
        If the token is too easily guessed, the run has no figure to show, or the run already has a simulated user or a
        replayed hand.
    ModelError
        If a clip does not exist, or a file cannot be read.
    SimError
        If the page cannot be served there, or the servo's process ends.
    """
    phantom_of(config.device)
    if config.body not in ("physical", "kinematic"):
        raise ParameterError("the live page shows a figure; expected --figure physical or kinematic, and its map")
    if config.user.does not in ("relaxed", "lead") or config.user.pushes or config.user.grabs:
        raise ParameterError("on the live page the hand is yours; leave out --user and what it does")
    token = token_for(host, given)
    if out.exists() and not out.is_dir():
        raise SimError(f"{out}: is a file; expected a folder for takes and clips")
    # The page reads them again in its own process, where an error would be visible in a browser only.
    if isinstance(config.map, MapFile):
        load_figure_map(Path(config.map.file))
    else:
        load_clips(config.map.clips, raw=True)
    page = Page(replace(config, seconds=MAX_SESSION_DURATION), out, port=0)
    try:
        gate = AccessGate(host, port, page.port, token)
        try:
            print("\n".join(_startup_lines(host, gate.port, out, token)), flush=True)
            page.serve()
        finally:
            gate.close()
    except KeyboardInterrupt:
        print(f"\nEnded; takes and clips are in {out}. hvf report {out}/takes/NAME draws a take.")
    finally:
        page.close()


def token_for(host: str, given: str) -> str | None:
    """Access token of the page on a host; None if the host is reachable from this machine only and no token is given.

    Raises
    ------
    ParameterError
        If the given token is too easily guessed.
    """
    if host in LOCAL_HOSTS and not given:
        return None
    if given and (len(given) < LEAST_TOKEN or not given.isascii() or not given.isalnum()):
        raise ParameterError(f"--token is too easily guessed; expected {LEAST_TOKEN} letters and digits or more")
    return given or secrets.token_hex(16)


def _startup_lines(host: str, port: int, out: Path, token: str | None) -> list[str]:
    if token is None:
        return [f"Open http://127.0.0.1:{port} and drag the orange ball; Ctrl-C ends.", f"Takes go to {out}."]
    return [
        f"Open http://{host}:{port}/?token={token} and drag the orange ball; Ctrl-C ends.",
        f"Takes go to {out}. The token is sent unencrypted: on an untrusted network, use ssh -L.",
    ]
