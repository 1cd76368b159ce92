"""Injection of a multisine into one axis' current reference: what it is made of, what of it is allowed, on and off."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from fractions import Fraction

from bench.errors import BenchError, Lacking
from bench.procedure.rig import Rig
from bench.rigfile.capabilities import Injection
from bench.rigfile.envelope import Envelope

MOST_LINES = 128
MOST_PERIODS = 16  # that count as one
WHOLE = 1e-6  # of the samples of a period: how far they may be from a whole number
CREST = 1.1  # greatest of Schroeder's phases over sqrt(2 lines) amplitudes: 1.08 at three lines, less elsewhere


@dataclass(frozen=True)
class Comb:
    """Lines at `first`, `first` + `step`, ... Hz, `count` of them, each of `amplitude` A 0-pk; `repeat_s`, after how long a
    single one counts as repeated, where that is not its own period."""

    first: float
    step: float
    count: int
    amplitude: float
    repeat_s: float = 0.0

    @property
    def hz(self) -> list[float]:
        """The lines."""
        return [self.first + k * self.step for k in range(self.count)]

    @property
    def period_s(self) -> float:
        """After which it repeats."""
        if self.repeat_s:
            return self.repeat_s
        a, b = Fraction(self.first).limit_denominator(4096), Fraction(self.step).limit_denominator(4096)
        whole = math.lcm(a.denominator, b.denominator)
        return whole / math.gcd(int(a * whole), int(b * whole))

    @property
    def peak(self) -> float:
        """What the sum does not exceed, A."""
        return self.amplitude * min(CREST * math.sqrt(2 * self.count), self.count)


def in_whole_samples(period_s: float, rate_hz: float) -> bool:
    """Whether a period has a whole number of samples."""
    samples = period_s * rate_hz
    return abs(samples - round(samples)) <= WHOLE * samples


def repeated(comb: Comb, rate_hz: float) -> Comb:
    """The same over so many of its periods that they have whole samples; as it is where no few of them have."""
    counts = (m for m in range(1, MOST_PERIODS + 1) if in_whole_samples(m * comb.period_s, rate_hz))
    count = next(counts, 1)
    return comb if count == 1 else replace(comb, repeat_s=count * comb.period_s)


def combs(first: float, step: float, last: float, amplitude: float) -> list[Comb]:
    """A band as combs of as many lines as the controller makes."""
    left, out = math.floor((last - first) / step + 1e-9) + 1, []
    while left > 0:
        out.append(Comb(first, step, min(left, MOST_LINES), amplitude))
        first, left = first + MOST_LINES * step, left - MOST_LINES
    return out


def parameters_of(can: Injection, comb: Comb) -> dict[str, float]:
    """The controller's parameters that make it."""
    values = (
        (can.hz, comb.first),
        (can.step, comb.step),
        (can.lines, float(comb.count)),
        (can.amplitude, comb.amplitude),
    )
    return {name: value for name, value in values if name}


def find_refusals(envelope: Envelope, can: Injection, comb: Comb) -> dict[str, str]:
    """Why the envelope refuses it, by what of the injection is refused: `hz`, `step`, `lines`, `amplitude`, `peak`; empty where
    it does not."""
    bound = {"hz": can.hz, "step": can.step, "lines": can.lines, "amplitude": can.amplitude}
    values = parameters_of(can, comb)
    found = {key: "; ".join(envelope.problems_of({name: values[name]})) for key, name in bound.items() if name}
    found["peak"] = envelope.injection_problem(comb.peak)
    return {key: why for key, why in found.items() if why}


@contextmanager
def inject(rig: Rig, axis: str, comb: Comb, settle_s: float) -> Iterator[None]:
    """With the injection into an axis, settled; off again in the end, whatever happens.

    Raises:
        InterlockError: the envelope does not allow it; nothing was sent.
    """
    Envelope(rig.file).check_injection(comb.peak)
    write, can = rig.levitation.write, rig.file.capabilities.injection
    if can is None:
        raise Lacking("capabilities.injection: found none")
    write(parameters_of(can, comb))
    try:
        write({can.axis: can.axes[axis]})
        rig.clock.sleep(settle_s)
        yield
    except BaseException:
        with suppress(BenchError):
            write({can.axis: can.off})
        raise
    write({can.axis: can.off})
