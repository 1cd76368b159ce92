"""Sequence and tick of a controller, which come round, as counters that do not; and which of them leapt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Integers = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]
SLACK, SHARE = 2, 0.02  # samples, and share of an advance, by which sequence and tick may differ
FAR = 4  # a sequence that went so many times as far as its tick began anew


@dataclass(frozen=True, slots=True)
class Unwrapping:
    """Bits of both counters, and `ticks` of a sample."""

    sequence_bits: int
    tick_bits: int
    ticks: float

    def advance(self, sequence: Integers, tick: Integers) -> tuple[Integers, Integers]:
        """By how many samples and ticks rows went on, from differences of counters that come round.

        The sequence alone does not tell a gap from one that is longer by a whole round; the tick does, and the other way
        about for a tick of few bits. From row to row, a sequence that leapt counts as its tick. Where the two do not agree
        otherwise, the sequence counts, unless it began anew by its tick.
        """
        steps, went = self.shortest(sequence - self._leapt(sequence, tick), tick)
        told, whole, agree = self._compared(steps, went)
        anew = (told > 0) & ((steps <= 0) | (steps > FAR * told + SLACK))
        return np.where(agree, whole, np.where(anew, told, steps)), went

    def _leapt(self, sequence: Integers, tick: Integers) -> Integers:
        """By how much the sequence of each row has leapt since the row that the differences are from."""
        steps, went = self.shortest(np.diff(sequence, prepend=0), np.diff(tick, prepend=0))
        told, sequences, _ = self._disagreeing(steps, went)
        out: Integers = np.cumsum(np.where(sequences, steps - told, 0))
        return out

    def shortest(self, sequence: Integers, tick: Integers) -> tuple[Integers, Integers]:
        """Both the short way round, but the tick as far as the sequence went where its bits allow that."""
        steps = signed(sequence, self.sequence_bits)
        due = np.round(steps * self.ticks).astype(np.int64)
        off = signed(tick - due, self.tick_bits)
        fits = np.abs(off) <= (SLACK + SHARE * np.abs(steps)) * self.ticks
        return steps, np.where(fits, due + off, signed(tick, self.tick_bits))

    def leaps(self, sequence: Integers, tick: Integers) -> tuple[int, int]:
        """How often the sequence and how often the tick leapt, from the differences of neighbouring rows."""
        _, sequences, ticks = self._disagreeing(*self.shortest(sequence, tick))
        return int(sequences.sum()), int(ticks.sum())

    def _disagreeing(self, steps: Integers, went: Integers) -> tuple[Integers, Mask, Mask]:
        """Samples by the tick, and where the sequence and where the tick went further than the other, either way. A tick
        that stands says nothing of the sequence."""
        told, _, agree = self._compared(steps, went)
        further = np.abs(steps) > np.abs(told)
        return told, ~agree & further & (told > 0), ~agree & ~further

    def _compared(self, steps: Integers, went: Integers) -> tuple[Integers, Integers, Mask]:
        """Samples by the tick, by the sequence with whole rounds added, and where these agree."""
        told = np.round(went / self.ticks).astype(np.int64)
        whole = told + signed(steps - told, self.sequence_bits)
        return told, whole, np.abs(whole - told) <= SLACK + SHARE * np.abs(told)


def signed(difference: Integers, bits: int) -> Integers:
    """A difference of counters of so many bits, taken the short way round."""
    half = np.int64(1) << (bits - 1)
    out: Integers = ((difference + half) & ((np.int64(1) << bits) - 1)) - half
    return out
