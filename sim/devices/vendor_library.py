"""Vendors' C libraries, which may not be redistributed: found where they are installed, loaded with signatures."""

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
        Name for messages, such as ``OpenHaptics' HD library``.
    names : tuple of str
        Names under which the system may find it; those that end in .dll are for Windows.
    install : str
        Hint on what to install if it is missing.
    signatures : mapping
        Result type and argument types of each function.
    """

    title: str
    names: tuple[str, ...]
    install: str
    signatures: Mapping[str, tuple[Any, list[Any]]]

    def find(self) -> str | None:
        """Path of the library; None if it is not installed."""
        candidates = [name for name in self.names if name.endswith(".dll") == (sys.platform == "win32")]
        return next((found for name in candidates if (found := ctypes.util.find_library(name))), None)

    def path(self) -> str:
        """Path of the library.

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
        """Load the library and set its signatures, from a path or from where it is installed.

        Raises
        ------
        SimError
            If it cannot be loaded, or lacks one of the functions.
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
