"""What hung masses pull at: by the rig file's tables, which axes of the bearings feel them, and how much of it each.

A weight W on a hook pulls down, or over a pulley to one side. A bearing whose axes look along a and b, which need not be at
right angles, answers a pull of 1 N at its plane by c_a along a and c_b along b, both together a force of 1 N against the pull:
with the angle o of that force

    c_a = sin(b - o)/sin(b - a)        c_b = sin(o - a)/sin(b - a)

At right angles c is the cosine of the angle between axis and force. An axis that feels less than a quarter of the pull (75.5
degrees from it and more) is not calibrated by it: the error of its direction would be most of what it feels.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from bench.errors import Lacking
from bench.rigfile import RigFile
from bench.rigfile.numbers import Sum
from bench.rigfile.places import PlaceError, Places
from bench.rigfile.supports import Support, SupportedAxis, once_per_rig, two_planes

LEAST = 0.25  # of a pull: what an axis must feel of it
PLUMB = math.radians(2.0)  # an axis nearer to the pull feels all of it: what 0.5 degrees change there is 3e-4
STANDS = 0.05  # cosine of a shaft's tilt below which no weight pulls across it
BRANCHES = {"i": "inboard AMB", "o": "outboard AMB"}


@dataclass(frozen=True)
class Loaded:
    """An axis that a pull loads. `key` is how results call it inside of the analysis, `title` how the reader knows it; `plane`
    0 of the bearing nearer to the near end, 1 of the other; `lean` is c of the page's equation, `mate` the other axis of its
    `bearing`; `plumb`: it looks along the pull, so that the directions' errors do not matter."""

    key: str
    name: str
    title: str
    plane: int
    coils: tuple[str, str]
    position: str
    mate: str
    bearing: str
    lean: float = 1.0
    plumb: bool = True

    @property
    def where(self) -> str:
        """How findings and records name its place: the bearing of a servomotor, else the axis."""
        return self.title.removesuffix(" AMB") if self.title != f"axis {self.name}" else self.name


@dataclass(frozen=True)
class Pull:
    """What is hung on one hook. `axes` are calibrated, `across` feel too little of it; `direction` in which it pulls, rad,
    math.pi is down; `sideways`: by a pulley."""

    hook: str
    axes: tuple[Loaded, ...]
    across: tuple[Loaded, ...] = ()
    sideways: bool = False
    tilted: bool = False
    bearings: tuple[str, str] = ("inboard", "outboard")

    @property
    def keys(self) -> tuple[str, ...]:
        """Of the axes, in order."""
        return tuple(a.key for a in self.axes)

    @property
    def planes(self) -> tuple[int, ...]:
        """Of the axes, in order."""
        return tuple(a.plane for a in self.axes)


def _plain(key: str, plane: int) -> Loaded:
    return Loaded(key, key, BRANCHES[key], plane, ("", ""), "", "", "")


SERVOMOTOR = Pull("", (_plain("i", 0), _plain("o", 1)))
"""Two bearings whose first axes stand upright: what the equations of the thesis have."""


def leans(pull: Pull, p: Mapping[str, float]) -> list[float | None]:
    """c of each axis by the model's inputs; None is 1. `p` has "at_<axis>" rad of axes that are not plumb, "misalignment" rad
    and "friction" of a pulley, "tilt" rad of a shaft that does not lie."""
    out: list[float | None] = []
    for axis in pull.axes:
        share = _lean(axis, pull, p) if not axis.plumb else None if axis.lean > 0 else -1.0  # -1: it looks down
        factor = (1 - p["friction"] if pull.sideways else 1.0) * (math.cos(p["tilt"]) if pull.tilted else 1.0)
        plain = not (pull.sideways or pull.tilted)
        out.append(share if plain else (axis.lean if share is None else share) * factor)
    return out


def _lean(axis: Loaded, pull: Pull, p: Mapping[str, float]) -> float:
    against = p.get("against", 0.0) + p.get("misalignment", 0.0)
    own, other = p[f"at_{axis.name}"], p[f"at_{axis.mate}"]
    return math.sin(other - against) / math.sin(other - own)


@once_per_rig
def pulls(rig: RigFile) -> tuple[Pull, ...]:
    """Of every hook, those that calibrate an axis; each axis by the hook that it feels most.

    Raises:
        Lacking: nothing pulls across the shaft, or the bearings are others than two with two axes each.
    """
    if (found := tilt(rig)) is not None and abs(math.cos(found.value)) < STANDS and not _pulleys(rig):
        raise Lacking(
            f"no weight across the shaft: found one that stands (shaft.tilt {math.degrees(found.value):.4g}°), and what hangs "
            "on it pulls along it; expected a hook with a pulley (hooks.NAME.pull, hooks.NAME.pulley), which pulls to the side"
        )
    if not rig.hooks:
        lines = ["hooks: found none; expected one, where known masses pull at the shaft"]
        raise Lacking(*lines, *([] if rig.masses else ["masses: found none; expected certified masses to hang"]))
    planes, places = two_planes(rig), Places(rig)
    try:
        made = [_pull(rig, places, planes, hook) for hook in rig.hooks]
    except PlaceError as error:
        raise Lacking(str(error)) from error
    best: dict[str, tuple[float, str]] = {}
    for pull in made:
        for axis in pull.axes:
            if abs(axis.lean) > best.get(axis.key, (0.0, ""))[0] + 1e-9:
                best[axis.key] = abs(axis.lean), pull.hook
    chosen = [_only(pull, {key for key, (_, hook) in best.items() if hook == pull.hook}) for pull in made]
    return tuple(pull for pull in chosen if pull.axes)


def _only(pull: Pull, keys: set[str]) -> Pull:
    axes = tuple(a for a in pull.axes if a.key in keys)
    rest = tuple(a for a in pull.axes if a.key not in keys)
    return replace(pull, axes=axes, across=(*pull.across, *rest))


def unloaded(rig: RigFile) -> tuple[Loaded, ...]:
    """Axes that no hook's pull is felt along."""
    made = pulls(rig)
    loaded = {a.name for pull in made for a in pull.axes}
    return tuple({a.name: a for pull in made for a in pull.across if a.name not in loaded}.values())


def _pulleys(rig: RigFile) -> list[str]:
    return [name for name, hook in rig.hooks.items() if hook.pull is not None]


def tilt(rig: RigFile) -> Sum | None:
    """Of the shaft against the horizontal, rad; None where the file says nothing, or that it lies."""
    if rig.shaft is None or rig.shaft.tilt is None:
        return None
    term = Places(rig).number(rig.shaft.tilt, "shaft.tilt")
    return Sum((term,)) if abs(term.number.value) > PLUMB else None


def against(rig: RigFile, hook: str) -> Sum:
    """The direction of the force that answers a hook's pull, rad: up, or away from the pulley."""
    if rig.hooks[hook].pull is None:
        return Sum()
    return Places(rig).direction(f"hooks/{hook}") + Sum(exact=math.pi)


def _pull(rig: RigFile, places: Places, planes: tuple[Support, Support], hook: str) -> Pull:
    places.place(f"hooks/{hook}")
    against_rad, sideways = against(rig, hook).value, rig.hooks[hook].pull is not None
    axes = [_loaded(rig, plane, k, one, against_rad) for k, plane in enumerate(planes) for one in plane.axes]
    felt = tuple(a for a in axes if abs(a.lean) >= LEAST)
    rest = tuple(a for a in axes if abs(a.lean) < LEAST)
    return Pull(hook, felt, rest, sideways, tilt(rig) is not None and not sideways, (planes[0].name, planes[1].name))


def _loaded(rig: RigFile, bearing: Support, plane: int, axis: SupportedAxis, against_rad: float) -> Loaded:
    other = next(a for a in bearing.axes if a is not axis)
    share = _share(math.sin(other.direction - against_rad) / math.sin(other.direction - axis.direction))
    off = abs(math.remainder(axis.direction - against_rad, math.pi))
    across = abs(abs(math.remainder(axis.direction - other.direction, math.pi)) - math.pi / 2)
    key, title = axis.name, f"axis {axis.name}"
    if any("radial force" in motor.gives for motor in rig.motors.values()) and off < PLUMB:
        key, title = "io"[plane], f"{bearing.name} AMB"
    coils = axis.coils[0], axis.coils[1]
    return Loaded(
        key, axis.name, title, plane, coils, axis.position, other.name, bearing.name, share, max(off, across) < PLUMB
    )


def _share(c: float) -> float:
    nearest = float(np.round(c))
    return nearest if abs(c - nearest) < 1e-12 else c


def channels(rig: RigFile) -> tuple[str, ...]:
    """What is recorded while masses hang, besides the flags: currents and positions of every axis, and what other probes
    read."""
    every = axes(pulls(rig)[0])
    return (*(coil for a in every for coil in a.coils), *(a.position for a in every), *further(rig))


def further(rig: RigFile) -> tuple[str, ...]:
    """Channels of the radial probes beside those that look along the axes."""
    own = {a.position for a in axes(pulls(rig)[0])}
    return tuple(p.channel for p in rig.probes.values() if p.direction is not None and p.channel not in own)


def axes(pull: Pull) -> tuple[Loaded, ...]:
    """All of both bearings: those that the pull loads, then those across it."""
    return (*pull.axes, *pull.across)
