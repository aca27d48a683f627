"""HDF5 files that were not closed by their writer: distinguished from damaged ones, and read without waiting.

HDF5 reads a file that is marked as being written with up to 100 attempts at every structure, with a waiting time that
doubles each time: on a torn structure it waits for ever. So a file is opened in that mode only while its writer runs,
which holds a shared lock on it. A file whose writer is gone, or that is shorter than its header says, is read as if it
had been closed at its present end: missing data then gives a read error at once.

Superblock of versions 2 and 3 (HDF5 File Format Specification 3.0, II.A), little-endian::

    0 signature (8)   8 version   9 size of offsets   10 size of lengths   11 flags
    12 base (8)   20 extension (8)   28 end of file (8)   36 root (8)   44 checksum (4): lookup3 of bytes 0 to 43
"""

import fcntl
import io
import os
import struct
from pathlib import Path
from typing import NamedTuple

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_SUPERBLOCK_SIZE, _WRITING_FLAGS, _CHECKSUM_OFFSET = 48, 0b101, 44  # opened for writing (bit 0), in SWMR mode (bit 2)
_END_OFFSET = 28


class Superblock(NamedTuple):
    """The 48 bytes of an HDF5 superblock, the size of the file [bytes] that they give, and the true one."""

    head: bytes
    end: int
    size: int

    @property
    def being_written(self) -> bool:
        """Whether its writer has not closed it."""
        return bool(self.head[11] & _WRITING_FLAGS)

    @property
    def whole(self) -> bool:
        """Whether it was closed, and has all its bytes."""
        return not self.being_written and self.size >= self.end

    @property
    def sound(self) -> bool:
        """Whether the superblock's checksum is right."""
        return lookup3(self.head[:_CHECKSUM_OFFSET]) == int.from_bytes(self.head[_CHECKSUM_OFFSET:], "little")

    @property
    def closed(self) -> bytes:
        """The superblock that the file would have if it had been closed at its true size."""
        head = bytearray(self.head)
        head[11] &= ~_WRITING_FLAGS
        struct.pack_into("<Q", head, _END_OFFSET, self.size)
        return bytes(head[:_CHECKSUM_OFFSET]) + lookup3(bytes(head[:_CHECKSUM_OFFSET])).to_bytes(4, "little")


def superblock(path: Path) -> Superblock | None:
    """Read the superblock of a file; None if it is no HDF5 file of these versions. OSError if it cannot be read."""
    with path.open("rb") as file:
        head, size = file.read(_SUPERBLOCK_SIZE), os.fstat(file.fileno()).st_size
    if len(head) < _SUPERBLOCK_SIZE or not head.startswith(_SIGNATURE) or head[8] not in (2, 3):
        return None
    return Superblock(head, struct.unpack_from("<Q", head, _END_OFFSET)[0], size)


def lock_for_writing(path: Path) -> int:
    """Mark a file as being written, by a shared lock; returns the descriptor, which holds the lock until closed."""
    descriptor = os.open(path, os.O_RDONLY)
    fcntl.flock(descriptor, fcntl.LOCK_SH)
    return descriptor


def has_writer(path: Path) -> bool:
    """Whether a living process is writing a file, that is, holds its lock."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False


class AsClosed(io.RawIOBase):
    """A file-like object, for h5py, that reads a file with its first bytes replaced by another superblock."""

    def __init__(self, path: Path, head: bytes):
        self._file, self._head = path.open("rb"), head

    def readable(self) -> bool:
        """See `io.IOBase`: True."""
        return True

    def seekable(self) -> bool:
        """See `io.IOBase`: True."""
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """See `io.IOBase`."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """See `io.IOBase`."""
        return self._file.tell()

    def readinto(self, buffer: bytearray) -> int:  # pyright: ignore[reportIncompatibleMethodOverride]
        """See `io.RawIOBase`; the first 48 bytes are those of the given superblock."""
        offset = self._file.tell()
        n = self._file.readinto(buffer)
        if offset < _SUPERBLOCK_SIZE:
            part = self._head[offset : offset + n]
            memoryview(buffer).cast("B")[: len(part)] = part
        return n

    def close(self) -> None:
        """See `io.IOBase`."""
        self._file.close()
        super().close()


def lookup3(data: bytes) -> int:
    """Bob Jenkins' hash lookup3 (``hashlittle``, 2006, public domain) with initial value 0, as used by HDF5."""

    def rotate(x: int, k: int) -> int:
        return ((x << k) | (x >> (32 - k))) & _UINT32_MASK

    a = b = c = (0xDEADBEEF + len(data)) & _UINT32_MASK
    blocks = max(0, -(-len(data) // 12) - 1)
    for i in range(blocks):
        x, y, z = struct.unpack_from("<III", data, 12 * i)
        a, b, c = (a + x) & _UINT32_MASK, (b + y) & _UINT32_MASK, (c + z) & _UINT32_MASK
        for k in (4, 6, 8, 16, 19, 4):
            a = ((a - c) & _UINT32_MASK) ^ rotate(c, k)
            c = (c + b) & _UINT32_MASK
            a, b, c = b, c, a
    if not data:
        return c
    x, y, z = struct.unpack("<III", data[12 * blocks :].ljust(12, b"\0"))
    a, b, c = (a + x) & _UINT32_MASK, (b + y) & _UINT32_MASK, (c + z) & _UINT32_MASK
    for k in (14, 11, 25, 16, 4, 14, 24):
        c = ((c ^ b) - rotate(b, k)) & _UINT32_MASK
        a, b, c = b, c, a
    return b


_UINT32_MASK = 0xFFFFFFFF
