"""Ways to damage a file: what disks, networks, editors and malice do."""

from __future__ import annotations

import struct

import numpy as np

_EXTREMES = (0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 0x7FFFFFFFFFFFFFFF, 0xFFFFFFFFFFFFFFFF)
_TEXTS = (
    b"nan",
    b"inf",
    b"-1",
    b"1e999",
    b'"',
    b",",
    b"\n",
    b"{",
    b"[[",
    b"\0",
    b"\xff",
    b"9" * 40,
    b"=",
    b"'''",
)


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """A copy of a file with one to four kinds of damage.

    Args:
        content: the good file.
        rng: which damage, and where.
    """
    data = bytearray(content)
    for _ in range(int(rng.choice([1, 1, 1, 2, 4]))):
        if not data:
            break
        data = _DAMAGE[int(rng.integers(len(_DAMAGE)))](data, rng)
    return bytes(data)


def _place(data: bytearray, rng: np.random.Generator) -> int:
    """Anywhere, but half of the time near an end, where headers and footers are."""
    if rng.random() < 0.5:
        near = min(len(data), 2000)
        place = int(rng.integers(near))
        return place if rng.random() < 0.5 else len(data) - 1 - place
    return int(rng.integers(len(data)))


def _flip_bits(data: bytearray, rng: np.random.Generator) -> bytearray:
    for _ in range(int(rng.integers(1, 9))):
        data[_place(data, rng)] ^= 1 << int(rng.integers(8))
    return data


def _set_bytes(data: bytearray, rng: np.random.Generator) -> bytearray:
    at, count = _place(data, rng), int(rng.integers(1, 17))
    data[at : at + count] = rng.bytes(min(count, len(data) - at))
    return data


def _cut_end(data: bytearray, rng: np.random.Generator) -> bytearray:
    return data[: _place(data, rng)]


def _cut_middle(data: bytearray, rng: np.random.Generator) -> bytearray:
    at = _place(data, rng)
    del data[at : at + int(rng.integers(1, 400))]
    return data


def _repeat(data: bytearray, rng: np.random.Generator) -> bytearray:
    at = _place(data, rng)
    part = bytes(data[at : at + int(rng.integers(1, 400))])
    data[at:at] = part * int(rng.integers(1, 4))
    return data


def _move(data: bytearray, rng: np.random.Generator) -> bytearray:
    at, count = _place(data, rng), int(rng.integers(1, 200))
    part = bytes(data[at : at + count])
    to = _place(data, rng)
    data[to : to + len(part)] = part[: len(data) - to]
    return data


def _extreme(data: bytearray, rng: np.random.Generator) -> bytearray:
    value, at = _EXTREMES[int(rng.integers(len(_EXTREMES)))], _place(data, rng)
    width = int(rng.choice([1, 2, 4, 8]))
    packed = struct.pack("<Q" if rng.random() < 0.7 else ">Q", value)
    packed = packed[:width] if rng.random() < 0.7 else packed[-width:]
    data[at : at + width] = packed[: len(data) - at]
    return data


def _text(data: bytearray, rng: np.random.Generator) -> bytearray:
    at, text = _place(data, rng), _TEXTS[int(rng.integers(len(_TEXTS)))]
    data[at : at + (len(text) if rng.random() < 0.5 else 0)] = text
    return data


def _zeros(data: bytearray, rng: np.random.Generator) -> bytearray:
    at, count = _place(data, rng), int(rng.integers(1, 4096))
    data[at : at + count] = bytes(min(count, len(data) - at))
    return data


_DAMAGE = (_flip_bits, _flip_bits, _set_bytes, _cut_end, _cut_middle, _repeat, _move, _extreme, _text, _zeros)
