"""What the fuzz targets have in common: changed streams, noise, random splits and random frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from bench.link.frames import FRAME, FrameBatch
from bench.wire.slcan import LENGTHS

Draw = np.random.Generator
Block = tuple[int, int, list[str]]
"""Inputs, frames or payloads or values accepted, findings."""

T_NS: Final = 1_767_225_600 * 10**9
INPUTS: Final = 10_000
"""About so many inputs in a block."""
LENGTH_CHOICES: Final = np.array((0, 1, 2, 8, *LENGTHS), np.uint8)


def mutated(stream: bytes, draw: Draw) -> bytes:
    """Some bytes replaced, dropped or doubled: about one change in 20, 200 or 2000 bytes."""
    rate = 10.0 ** -draw.uniform(1.3, 3.3)
    octets = np.frombuffer(stream, np.uint8).copy()
    hit = draw.random(len(octets)) < rate
    octets[hit] = draw.integers(0, 256, int(hit.sum()))
    times = np.ones(len(octets), np.intp)
    hit = draw.random(len(octets)) < rate
    times[hit] = draw.choice((0, 2), int(hit.sum()))
    return np.repeat(octets, times).tobytes()


def noise(draw: Draw, alphabet: bytes, delimiter: int, inputs: int) -> bytes:
    """Random characters with delimiters at random places; half of the time with a favourite gap."""
    mean = int(draw.integers(2, 24))
    octets = np.frombuffer(alphabet, np.uint8)[draw.integers(0, len(alphabet), inputs * mean)]
    octets[draw.random(len(octets)) < 1 / mean] = delimiter
    return octets.tobytes()


def pieces(data: bytes, draw: Draw) -> list[bytes]:
    """The bytes cut at random places, now and then into single bytes; empty pieces too."""
    if draw.random() < 0.1:
        head = 4000
        return [data[at : at + 1] for at in range(min(head, len(data)))] + [data[head:]]
    cuts = np.sort(draw.integers(0, len(data) + 1, int(draw.integers(1, 300)))).tolist()
    return [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]


def batch_of(draw: Draw, count: int, lengths: Sequence[int], identifiers: int) -> FrameBatch:
    """Random frames."""
    batch = np.zeros(count, FRAME)
    batch["id"] = draw.integers(0, identifiers, count)
    batch["length"] = draw.choice(np.asarray(lengths, np.uint8), count)
    batch["data"] = draw.integers(0, 256, (count, 64), np.uint8)
    batch["data"] *= np.arange(64) < batch["length"][:, None]
    return batch
