"""Libraries of vendors, which are not ours to ship: found where they are installed, loaded with their signatures."""

import ctypes
import ctypes.util
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sim.errors import SimError


@dataclass(frozen=True)
class VendorLibrary:
    """A vendor's C library.

    Parameters
    ----------
    title : str
        For people, such as ``OpenHaptics' HD library``.
    names : tuple of str
        By which the system may know it, on Windows those that end in .dll.
    install : str
        What to install where it is missing.
    signatures : mapping
        Of its functions: type of the result, and of the arguments.
    """

    title: str
    names: tuple[str, ...]
    install: str
    signatures: Mapping[str, tuple[Any, list[Any]]]

    def find(self) -> str | None:
        """Where it is; None if it is not installed."""
        ours = [name for name in self.names if name.endswith(".dll") == (sys.platform == "win32")]
        return next((found for name in ours if (found := ctypes.util.find_library(name))), None)

    def path(self) -> str:
        """Where it is.

        Raises
        ------
        SimError
            If it is not installed.
        """
        path = self.find()
        if path is None:
            raise SimError(f"{self.title} is not installed; {self.install}")
        return path

    def load(self, path: str | None = None) -> ctypes.CDLL:
        """The library with its signatures, from a path or from where it is installed.

        Raises
        ------
        SimError
            If it is not there, or is another library.
        """
        path = path or self.path()
        try:
            library = ctypes.CDLL(path)
            for name, (result, arguments) in self.signatures.items():
                function = getattr(library, name)
                function.restype, function.argtypes = result, arguments
        except (OSError, AttributeError) as error:
            raise SimError(f"{path} is not {self.title}: {error}") from None
        return library
