"""The lines of a log, one at a time, whatever packs or encodes them; nothing is ever held whole."""

import codecs
import gzip
import io
import lzma
import stat
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import BinaryIO

from lemtomap.errors import BadLog

LONGEST_LINE = 1_000_000  # characters; a scan of 1081 beams takes 10,000
MOST_BYTES = 1_000_000_000  # of text
MOST_PACKED = 100  # bytes of text from one byte of file; measured numbers pack 5 to 10 times
FREE_BYTES = 8_000_000  # that may come out of fewer bytes: a robot that stood packs well
PEEK = 64

_UNPACKERS: dict[str, Callable[[BinaryIO], gzip.GzipFile | lzma.LZMAFile]] = {
    ".gz": lambda raw: gzip.GzipFile(fileobj=raw),
    ".xz": lzma.LZMAFile,
}
PACKED = frozenset(_UNPACKERS)
_MARKS = (  # the longer ones first: UTF-32's begins with UTF-16's
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
    (codecs.BOM_UTF8, "utf-8-sig"),
)


class _Metered(io.RawIOBase):
    """Unpacked bytes, counted against the packed ones they come from: refuses what no log can be."""

    def __init__(self, source: gzip.GzipFile | lzma.LZMAFile | BinaryIO, raw: BinaryIO) -> None:
        self._source, self._raw = source, raw
        self._bytes = self._packed_bytes = 0
        self._unpaid_bytes = 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: bytearray | memoryview) -> int:  # type: ignore[override]
        data = self._source.read(len(buffer))
        buffer[: len(data)] = data
        packed_bytes = self._raw.tell()
        paid_bytes = MOST_PACKED * (packed_bytes - self._packed_bytes)
        self._bytes, self._packed_bytes = self._bytes + len(data), packed_bytes
        self._unpaid_bytes = max(0, self._unpaid_bytes + len(data) - paid_bytes)
        if self._unpaid_bytes > FREE_BYTES:
            raise BadLog(
                f"unpacks to more than {MOST_PACKED} times its size: if it is a log, unpack it first"
            )
        if self._bytes > MOST_BYTES:
            raise _too_long()
        return len(data)


def lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield (line number from 1, line with its end) of a text file, packed where its suffix says so.

    Read are UTF-8, UTF-16 and UTF-32 with and without a mark, and every kind of line end. Raises BadLog, one
    line that names the file and the reason, also while being iterated.
    """
    suffix = path.suffix.lower()
    blank = True
    try:
        _refuse_non_file(path, packed=suffix in PACKED)
        with path.open("rb") as raw:
            source = _UNPACKERS[suffix](raw) if suffix in _UNPACKERS else raw
            metered = io.BufferedReader(_Metered(source, raw), 1 << 16)
            text = io.TextIOWrapper(metered, _encoding(metered.peek(PEEK)[:PEEK]), errors="replace")
            for number, line in enumerate(iter(partial(text.readline, LONGEST_LINE + 1), ""), start=1):
                _refuse_endless(number, line)
                blank = blank and not line.strip()
                yield number, line
    except BadLog as error:
        raise BadLog(f"{path}: {error}") from None
    except FileNotFoundError:
        raise BadLog(f"{path}: no such file") from None
    except (EOFError, gzip.BadGzipFile, lzma.LZMAError, zlib.error) as error:
        raise BadLog(f"{path}: not a whole {suffix} file: {error}") from None
    except OSError as error:
        raise BadLog(f"{path}: cannot be read: {error.strerror or error}") from None
    if blank:
        raise BadLog(f"{path}: the file is empty")


def _refuse_non_file(path: Path, *, packed: bool) -> None:
    """Raise BadLog for a pipe or a device, which may never end, a folder, and what is too long."""
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise BadLog("is no file")
    if not packed and status.st_size > MOST_BYTES:
        raise _too_long()


def _refuse_endless(number: int, line: str) -> None:
    if len(line) > LONGEST_LINE:
        raise BadLog(f"line {number} is longer than {LONGEST_LINE:,} characters: this is no log")


def _too_long() -> BadLog:
    return BadLog(f"more than {MOST_BYTES / 1e9:g} GB of text: cut it into parts")


def _encoding(begin: bytes) -> str:
    """Return how the text is encoded, told from its first bytes."""
    for mark, encoding in _MARKS:
        if begin.startswith(mark):
            return encoding
    if len(begin) >= 2 and not any(begin[1::2]):
        return "utf-16-le"
    if len(begin) >= 2 and not any(begin[0::2]):
        return "utf-16-be"
    return "utf-8"
