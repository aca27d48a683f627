"""Check, before the first trial, that recordings of trials can be written to their folder or URL."""

from experiments.trials.design.errors import StudyError

_PROBE_FILE = ".hvf"


def check_writable(url: str) -> None:
    """Write an empty file to a folder or URL, and remove it again.

    Raises
    ------
    StudyError
        If nothing can be written there.
    """
    try:
        import fsspec

        system, path = fsspec.core.url_to_fs(url)
        system.makedirs(path, exist_ok=True)
        system.pipe_file(f"{path}/{_PROBE_FILE}", b"")
        system.rm_file(f"{path}/{_PROBE_FILE}")
    except Exception as error:  # every storage backend has its own exceptions
        reason = " ".join(str(error).split()) or type(error).__name__
        raise StudyError(
            f"recordings = {url!r}: {reason}; expected a folder, or a URL that fsspec can write to"
        ) from None
