"""Which axes are moved, and what was recorded of them while they were: readings, set points, what loops ask and get."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from bench.findings import Effect, Finding
from bench.procedure import Quantity
from bench.procedure.requires import Requires
from bench.recording import Recording, Step
from bench.rigfile import RigFile
from bench.rigfile.binding import STAGE_HELD
from bench.rigfile.roles import STATE
from bench.rigfile.stage import StageAxis, axes_of
from procedures.shared import signals
from procedures.stages.counts import lacks_counts, pitch_of

Array = npt.NDArray[np.float64]
TOGETHER = "together"
INTEGRATORS = "integrators"
STANDS = 1.5  # counts, in which a reading that stands may change
LIMIT = 0.999  # of a loop's greatest force: it is there
NEARLY = 0.97  # of the greatest current that the controller allows: it is there
SERVED = 0.05  # of a loop's greatest force, that what it gets may be off what it asks
SHARE = 2e-3  # of samples, for which that may be so
Moved = Literal["all", "stroke", "angle"]


@dataclass(frozen=True)
class Mode:
    """Axes that are moved at once: one alone, or all of them."""

    name: str
    axes: tuple[StageAxis, ...]


@dataclass(frozen=True)
class Track:
    """One axis over one step: `t` (n,) s from its first sample on, its reading and its set point, m or rad, what its loop asks
    for and what it gets, N or N m (empty where not bound); modes that the controller was in; samples lost and expected; in what
    share of them a motor's current was at the controller's limit."""

    axis: StageAxis
    t: Array
    read: Array
    reference: Array
    asked: Array
    given: Array
    modes: tuple[str, ...]
    lost: int
    expected: int
    full: float = 0.0


def chosen(rig: RigFile, moved: Moved) -> tuple[StageAxis, ...]:
    """Axes that a plan moves, in the file's order."""
    return tuple(a for a in axes_of(rig).values() if moved in ("all", a.measures))


def modes(rig: RigFile, moved: Moved, *, together: bool) -> tuple[Mode, ...]:
    """Each axis alone, then all at once."""
    axes = chosen(rig, moved)
    alone = tuple(Mode(a.name, (a,)) for a in axes)
    return (*alone, Mode(TOGETHER, axes)) if together and len(axes) > 1 else alone


def waits_at(axis: StageAxis) -> float:
    """Where an axis is held while another one moves: at its zero, or as near to it as it gets."""
    return min(max(0.0, axis.low), axis.high)


def where_of(mode: Mode, axis: StageAxis, *more: str) -> str:
    """What the place of a result is called."""
    return ", ".join((axis.name, *((TOGETHER,) if mode.name == TOGETHER else ()), *(m for m in more if m)))


def named(name: str, axis: StageAxis) -> str:
    """A quantity of lengths, or its sister of angles."""
    return name if axis.unit == "m" else f"{name}_angle"


def sisters(name: str, text: str) -> tuple[Quantity, Quantity]:
    """A quantity of lengths and its sister of angles."""
    return Quantity(name, "m", text), Quantity(f"{name}_angle", "rad", text)


def untold(rig: RigFile, pairs: Iterable[tuple[Quantity, Quantity]]) -> tuple[Quantity, ...]:
    """Sisters of a measure that a rig has no axis of."""
    units = {a.unit for a in axes_of(rig).values()}
    return tuple(q for pair in pairs for q in pair if q.unit not in units)


def left_out(moved: Moved, pairs: Iterable[tuple[Quantity, Quantity]]) -> tuple[Quantity, ...]:
    """Sisters of a measure that a plan does not move."""
    unit = {"all": "", "stroke": "rad", "angle": "m"}[moved]
    return tuple(q for pair in pairs for q in pair if q.unit == unit)


def settings_of(rig: RigFile, integrators: str) -> Mapping[str, float]:
    """What the rig file calls the plan's choice of integrators; nothing where it knows none."""
    return rig.capabilities.settings.get(INTEGRATORS, {}).get(integrators, {})


def problems_of(rig: RigFile, moved: Moved, integrators: str) -> Iterator[str]:
    """What a plan asks too much of any positioned stage."""
    known = rig.capabilities.settings.get(INTEGRATORS, {})
    if integrators not in known and (known or integrators not in ("", "on")):
        yield f"integrators: found {integrators!r}; expected one of {', '.join(known) or 'on (the rig file has no choice)'}"
    if not chosen(rig, moved):
        yield f"moved: found {moved!r}; the rig has no axis that measures that"


def without(integrators: str) -> str:
    """Part of a place's name where the integrators are not on."""
    return "" if integrators in ("", "on") else f"{INTEGRATORS} {integrators}"


def requires(rig: RigFile, parts: Sequence[str] = ()) -> Requires:
    """A positioned stage whose set points and counts are known; `parts` of an axis that it must have."""
    axes = axes_of(rig).values()
    if not axes:
        return Requires(roles=("motion",), capabilities=("positioning",))
    lacks = [f"capabilities.positioning.axes.{a.name}: found no {part}" for a in axes for part in ("reference", *parts)
             if not getattr(a, part)]  # fmt: skip
    return Requires(
        roles=("motion",), channels=(*(a.channel for a in axes), STATE), capabilities=("positioning",),
        uses=("settings.integrators", "current_limit"), lacks=(*lacks, *lacks_counts(rig)),
    )  # fmt: skip


def currents_of(rig: RigFile) -> tuple[str, ...]:
    """Channels of the motors' currents, of a controller that has a limit for them."""
    if rig.capabilities.current_limit not in rig.parameters:
        return ()
    return tuple(c for motor in rig.motors.values() for c in motor.currents if c in rig.channels)


def tracks_of(recording: Recording[Any], step: Step, axes: Iterable[StageAxis]) -> dict[str, Track]:
    """Tracks by the axes' names."""
    rig, axes = recording.rig, tuple(axes)
    names, currents = [c for a in axes for c in (a.channel, a.reference, a.asked, a.given) if c], currents_of(rig)
    data = step.read(*dict.fromkeys((*names, *currents, STATE)))
    t, codes, empty = (data["t_ns"] - data["t_ns"][:1]) * 1e-9, rig.choices(STATE), np.empty(0)
    told = tuple(codes.get(int(c), str(int(c))) for c in np.unique(data[STATE]))
    found = tuple(rig.binding.mode(name) or name for name in told)
    full = 0.0
    if currents and len(t):
        limit = rig.parameters[rig.capabilities.current_limit].default
        full = float((np.max([np.abs(data[c]) for c in currents], axis=0) > NEARLY * limit).mean())
    return {
        a.name: Track(
            a, t, data[a.channel], data[a.reference], data.get(a.asked, empty), data.get(a.given, empty), found,
            step.lost(), step.expected(), full,
        )
        for a in axes
    }  # fmt: skip


def of_signals(tracks: Mapping[str, Sequence[Track]], max_lost: float) -> Iterator[Finding]:
    """By mode and axis: losses, states in which nothing was held, encoders that never moved."""
    every = [(where, t) for where, some in tracks.items() for t in some]
    for where, t in every:
        if other := [m for m in t.modes if m not in STAGE_HELD]:
            text = f"the controller was in {', '.join(other)}: it did not hold the axes"
            yield Finding("axis-not-held", text, where, Effect.ERROR)
            return
    lost, expected = (np.array([getattr(t, k) for _, t in every], dtype=float) for k in ("lost", "expected"))
    yield from signals.losses(lost, expected, max_lost, lambda share: every[int(np.argmax(share))][0])
    for where, some in tracks.items():
        axis = some[0].axis
        spans = [float(np.ptp(t.read)) for t in some if len(t.read)]
        if spans and max(spans) < STANDS * pitch_of(axis):
            text = (f"{axis.channel} does not change while {axis.name} is sent to and fro: the axis is stuck, or its encoder. "
                    "Is a brake left on?")  # fmt: skip
            yield Finding("never-moved", text, where, Effect.ERROR)


def of_forces(rig: RigFile, tracks: Mapping[str, Sequence[Track]]) -> Iterator[Finding]:
    """Loops that ask for all they may, currents at their limit, demands that are not served: what is measured then is that of
    the limits."""
    for where, some in tracks.items():
        axis = some[0].axis
        if (share := float(np.mean([t.full for t in some]))) > SHARE:
            text = f"a motor's current is at the controller's limit in {share:.1%} of the samples"
            yield Finding("current-saturated", text, where)
        parameter = rig.parameters.get(axis.limit)
        asked, given = (np.concatenate([getattr(t, k) for t in some]) for k in ("asked", "given"))
        if parameter is None or not len(asked):
            continue
        full = float((np.abs(asked) >= LIMIT * parameter.default).mean())
        if full > SHARE:
            text = f"the loop asks for its limit, {parameter.default:g} {axis.force}, in {full:.1%} of the samples"
            yield Finding("force-at-limit", text, where)
        apart = np.abs(asked - given) > SERVED * parameter.default if len(given) == len(asked) else np.zeros(1)
        if float(apart.mean()) > SHARE:
            text = (f"in {float(apart.mean()):.1%} of the samples the axis does not get the force that its loop asks for: a "
                    "limit of the currents, or phases that cannot give it there")  # fmt: skip
            yield Finding("force-not-given", text, where)
