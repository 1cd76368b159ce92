"""Pairs of axes of a stage, one that moves and one that is held, and how waves are played and set back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Literal

from bench.errors import BenchError
from bench.procedure.rig import Rig
from bench.rigfile import RigFile
from bench.rigfile.stage import StageAxis, axes_of

Moved = Literal["all", "stroke", "angle"]
MACHINE = {"m": "mass", "rad": "polar_inertia"}
PARTS = ("reference", "asked", "stiffness", "wave")


@dataclass(frozen=True)
class Pair:
    """An axis that moves and one that is held meanwhile."""

    moved: StageAxis
    held: StageAxis

    @property
    def where(self) -> str:
        """As results and findings name it."""
        return f"{self.held.name} while {self.moved.name}"


def pairs(rig: RigFile, moved: Moved) -> tuple[Pair, ...]:
    """Every pair, in the file's order: all that are held while the first one moves come first."""
    axes = tuple(axes_of(rig).values())
    return tuple(Pair(m, h) for m in axes if moved in ("all", m.measures) for h in axes if h is not m)


def lacks(rig: RigFile) -> Iterator[str]:
    """What a positioned stage has not got of two axes that play waves."""
    axes = axes_of(rig)
    if len(axes) < 2:
        yield f"capabilities.positioning.axes: found {len(axes)}; expected two or more"
    for name, axis in axes.items():
        if missing := [part for part in PARTS if not getattr(axis, part)]:
            yield f"capabilities.positioning.axes.{name}: found no {', '.join(missing)}"
        elif axis.wave is not None and (axis.wave.sine is None or not axis.wave.amplitude or not axis.wave.period):
            yield f"capabilities.positioning.axes.{name}.wave: found no sine with amplitude and period"
        if axis.pitch is None:
            yield f"encoders.{name}: found no pitch; expected what a count is"


def inertia_of(rig: RigFile, axis: StageAxis, stated: Mapping[str, float]) -> float:
    """What an axis moves, kg or kg m^2: as a plan states it, else by the rig file; 0 where neither says."""
    number = rig.machine.get(MACHINE[axis.unit])
    return stated.get(axis.name, 0.0 if number is None else number.value)


def waits_at(axis: StageAxis) -> float:
    """Where an axis is held: at its zero, or as near to it as it gets."""
    return min(max(0.0, axis.low), axis.high)


def silenced(rig: RigFile) -> dict[str, float]:
    """Parameters with which no axis plays."""
    return {a.wave.kind: float(a.wave.off) for a in axes_of(rig).values() if a.wave is not None}


def sine(axis: StageAxis, amplitude: float, period_s: float) -> dict[str, float]:
    """Parameters of a sine about the target."""
    wave = axis.wave
    assert wave is not None
    assert wave.sine is not None
    turned = {wave.phase: 0.0} if wave.phase else {}
    return {wave.kind: float(wave.sine), wave.amplitude: amplitude, wave.period: period_s, **turned}


@contextmanager
def played(rig: Rig, values: Mapping[str, float]) -> Iterator[None]:
    """Waves that go on; in the end axes are at rest where they were sent, and nothing plays."""
    assert rig.motion is not None
    rig.motion.write({**silenced(rig.file), **values})
    rig.motion.play()
    try:
        yield
    except BaseException:
        with suppress(BenchError):
            rig.motion.stop()
        raise
    rig.motion.stop()
    rig.motion.write(silenced(rig.file))
