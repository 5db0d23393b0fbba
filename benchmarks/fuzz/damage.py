"""Damage bytes the way disks, wires and hands do, and some ways that only an enemy does."""

from collections.abc import Iterator

import numpy as np

EDGES = (b"\x00", b"\xff", b"\x7f", b"\x80", b"\xff\xff\xff\x7f", b"\x00\x00\xc0\x7f", b"\xff" * 8)
WORDS = (
    b"[" * 3000, b'{"a":' * 500, b"1e999", b"-1", b"NaN", b"9" * 400, b"null", b'""', b"\n", b";",
    b"&a [*a,*a]", b"..", b"\xed\xa0\x80", b"18446744073709551616", b"<!DOCTYPE x>", b"[]", b"{}",
)  # fmt: skip
DRAWS = 32
ONE_TO_THREE = (1, 1, 1, 2, 3)


def draws(rng: np.random.Generator) -> Iterator[int]:
    """Yield whole numbers from 0 to 2³¹, drawn many at a time."""
    while True:
        yield from rng.integers(1 << 31, size=1024).tolist()


def damaged(data: bytes, other: bytes, drawn: Iterator[int]) -> bytes:
    """Return `data` with one to three things done to it; `other` is another sample to splice."""
    for _ in range(ONE_TO_THREE[next(drawn) % 5]):
        kind, at = next(drawn) % 9, next(drawn) % (len(data) + 1)
        if kind <= 2 and data:
            flipped = bytearray(data)
            for _ in range(1 + next(drawn) % 3):
                flipped[next(drawn) % len(data)] ^= 1 << next(drawn) % 8
            data = bytes(flipped)
        elif kind == 3:
            data = data[:at]
        elif kind == 4:
            edge = EDGES[next(drawn) % len(EDGES)]
            data = data[:at] + edge + data[at + len(edge) :]
        elif kind == 5:
            word = WORDS[next(drawn) % len(WORDS)]
            data = data[:at] + word + data[at + next(drawn) % 6 :]
        elif kind == 6:
            data = data[:at] + other[next(drawn) % (len(other) + 1) :]
        elif kind == 7:
            end = at + next(drawn) % (len(data) + 1 - at)
            data = data[:end] + data[at:end] + data[end:]
        elif next(drawn) % 3 == 0:
            data = bytes(next(drawn) % 256 for _ in range(next(drawn) % 64))
        else:
            data = data[at:]
    return data
