"""Damage to files: of bytes, of text and of packed files; recordings and maps have modules of their own.

Every mutation takes the sound file and a random generator and returns the damaged file.
"""

import functools
import gzip
import lzma
import random
import re
from collections.abc import Callable

Mutation = Callable[[bytes, random.Random], bytes]

HUGE = (
    "1e308", "-1e308", "1e999", "1e12", "-1e12", "99999999999999999999999999", "nan", "-nan", "inf", "-inf",
    "0", "-0", "-1", "1e-320", "0x10", "1_000", "0.1.2", "true", "''", "~", "4294967296",
)  # fmt: skip
JUNK = (
    b"\x00" * 17,
    b"\xff\xfe",
    b"\x1b[2J\x1b]0;x\x07",
    b"\r",
    b"\n\n\n",
    "é漢\u202e".encode(),
    b"%s%n{}$\\",
)
BOMB_MEMBER = 256 * 2**20
BOMB_MEMBERS = 16


# ---- bytes ----


def _span(data: bytes, rng: random.Random) -> tuple[int, int]:
    """Return a random stretch of the file, rarely a long one."""
    start = rng.randrange(len(data) + 1)
    return start, min(len(data), start + rng.choice((1, 2, 8, 64, 1024, len(data) // 4)))


def flip_bits(data: bytes, rng: random.Random) -> bytes:
    """Flip some bits."""
    damaged = bytearray(data)
    for _ in range(rng.choice((1, 1, 3, 20))):
        damaged[rng.randrange(len(damaged))] ^= 1 << rng.randrange(8)
    return bytes(damaged)


def overwrite(data: bytes, rng: random.Random) -> bytes:
    """Write random bytes over a stretch."""
    start, end = _span(data, rng)
    return data[:start] + rng.randbytes(end - start) + data[end:]


def cut_tail(data: bytes, rng: random.Random) -> bytes:
    """Lose everything from somewhere on."""
    return data[: rng.randrange(len(data) + 1)]


def cut_stretch(data: bytes, rng: random.Random) -> bytes:
    """Lose a stretch in the middle."""
    start, end = _span(data, rng)
    return data[:start] + data[end:]


def insert_junk(data: bytes, rng: random.Random) -> bytes:
    """Put something foreign in between."""
    at = rng.randrange(len(data) + 1)
    junk = rng.choice((*JUNK, rng.randbytes(rng.choice((1, 5, 300)))))
    return data[:at] + junk + data[at:]


def repeat_stretch(data: bytes, rng: random.Random) -> bytes:
    """Have a stretch twice."""
    start, end = _span(data, rng)
    return data[:end] + data[start:end] + data[end:]


def swap_stretches(data: bytes, rng: random.Random) -> bytes:
    """Exchange two neighbouring stretches."""
    a, b, c = sorted(rng.randrange(len(data) + 1) for _ in range(3))
    return data[:a] + data[b:c] + data[a:b] + data[c:]


BYTES: tuple[Mutation, ...] = (
    flip_bits, overwrite, cut_tail, cut_stretch, insert_junk, repeat_stretch, swap_stretches,
)  # fmt: skip


# ---- text ----


def huge_number(data: bytes, rng: random.Random) -> bytes:
    """Put something that is hardly a number in the place of one."""
    found = list(re.finditer(rb"[-+]?[0-9][0-9.eE+-]*", data))
    if not found:
        return insert_junk(data, rng)
    for match in sorted(rng.sample(found, min(len(found), rng.choice((1, 1, 4)))), key=lambda m: -m.start()):
        data = data[: match.start()] + rng.choice(HUGE).encode() + data[match.end() :]
    return data


def repeat_digits(data: bytes, rng: random.Random) -> bytes:
    """Make a number thousands of digits long."""
    found = list(re.finditer(rb"[0-9]", data))
    at = rng.choice(found).end() if found else 0
    return data[:at] + b"9" * rng.choice((30, 400, 5000)) + data[at:]


def nest(data: bytes, rng: random.Random) -> bytes:
    """Open brackets without end, or close them again."""
    opened, closed = rng.choice(((b"[", b"]"), (b"{a: ", b"}"), (b"- ", b""), (b"{a={", b"}}"), (b"(", b")")))
    depth = rng.choice((40, 3000, 60_000))
    found = list(re.finditer(rb"[-+]?[0-9][0-9.]*", data))
    at = rng.choice(found).start() if found else rng.randrange(len(data) + 1)
    return data[:at] + opened * depth + b"1" + closed * (depth if rng.random() < 0.7 else 0) + data[at:]


def lines_changed(data: bytes, rng: random.Random) -> bytes:
    """Lose, repeat, exchange or lengthen a line."""
    lines = data.splitlines(keepends=True) or [b""]
    at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    kind = rng.randrange(4)
    if kind == 0:
        del lines[at]
    elif kind == 1:
        lines[at:at] = [lines[at]] * rng.choice((1, 3, 200))
    elif kind == 2:
        lines[at], lines[other] = lines[other], lines[at]
    else:
        lines[at] = lines[at].rstrip(b"\n") * rng.choice((3, 2000)) + b"\n"
    return b"".join(lines)


def words_exchanged(data: bytes, rng: random.Random) -> bytes:
    """Put one word of the file in the place of another."""
    found = list(re.finditer(rb"[^\s]+", data))
    if not found:
        return insert_junk(data, rng)
    at, other = rng.choice(found), rng.choice(found)
    return data[: at.start()] + other.group() + data[at.end() :]


def encoded_anew(data: bytes, rng: random.Random) -> bytes:
    """Store the text as another program would."""
    text = data.decode("latin-1")
    return rng.choice(
        (text.encode("utf-16"), b"\xef\xbb\xbf" + data, data.replace(b"\n", b"\r\n"), b" " + data)
    )


def yaml_aliases(data: bytes, rng: random.Random) -> bytes:
    """Let a few lines grow to billions."""
    levels = rng.choice((4, 9, 30))
    lines = ["a0: &a0 [x,x,x,x,x,x,x,x,x]"]
    lines += [f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 9)}]" for i in range(1, levels)]
    return "\n".join(lines).encode() + b"\n" + data


TEXT: tuple[Mutation, ...] = (
    huge_number, huge_number, huge_number, repeat_digits, nest, lines_changed, words_exchanged, encoded_anew,
    *BYTES,
)  # fmt: skip
YAML: tuple[Mutation, ...] = (*TEXT, yaml_aliases)


# ---- packed ----


def repacked(pack: Callable[[bytes], bytes], unpack: Callable[[bytes], bytes]) -> Mutation:
    """Damage the text inside, packed soundly."""

    def mutation(data: bytes, rng: random.Random) -> bytes:
        return pack(rng.choice(TEXT)(unpack(data), rng))

    return mutation


def bomb(pack: Callable[[bytes], bytes]) -> Mutation:
    """Let a small file unpack to 4 GB."""

    @functools.cache
    def member() -> bytes:
        return pack(b"0" * BOMB_MEMBER)

    def mutation(data: bytes, rng: random.Random) -> bytes:
        # rarely, since each costs its reader as much as hundreds of others
        if rng.random() < 0.8:
            return flip_bits(data, rng)
        return data + member() * BOMB_MEMBERS

    return mutation


GZIP: tuple[Mutation, ...] = (
    *BYTES,
    *[repacked(lambda data: gzip.compress(data, 1, mtime=0), gzip.decompress)] * 8,
    bomb(lambda data: gzip.compress(data, 1, mtime=0)),
)
XZ: tuple[Mutation, ...] = (
    *BYTES,
    *[repacked(lambda data: lzma.compress(data, preset=0), lzma.decompress)] * 8,
    bomb(lambda data: lzma.compress(data, preset=0)),
)
