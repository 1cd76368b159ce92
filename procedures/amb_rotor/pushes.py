"""Which way probes count where gravity does not say it: somebody pushes the shaft aside, before it is lifted.

A shaft that stands, or an axis across gravity, shows no polarity at rest: a loop of which both probe and coils are reversed
floats as well, and one of which only the probe is reversed throws the shaft against its rings. So before the lift the operator
pushes the shaft in a direction e of the rig file until it touches its rings, at a distance c. A probe that looks along a then
reads c (a e), its sign with it: half of the clearance and more where a and e are less than 60 degrees apart. One push shows
all probes that look about that way; one that shows at those across instead has exchanged axes.

A shaft that lies is pushed with about as much as it weighs, and stands where push and weight together press it to each ring.
That is not where it is pushed, the less so where it overhangs: then its rings carry more than it weighs, and one holds it down.
So what a probe should read follows from that lever (`leaning`), and of both ways along a probe the one is asked for that shows.

Where nobody can be asked nothing is shown, and a note says so (`polarity-not-shown`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bench.errors import Lacking
from bench.findings import Effect, Finding
from bench.procedure.rig import Rig
from bench.procedure.roles import Push
from bench.recording import Recording
from bench.recording.recorder import Recorder
from bench.rigfile import RigFile
from bench.rigfile.supports import least_clearance
from procedures.amb_rotor import leaning, rings
from procedures.amb_rotor.stations import Stations, stations
from procedures.shared import first_look

PUSH = "push"
ABOUT = 0.7  # of the clearance: a push shows the polarity of probes that read as much of it, by 45 degrees from it
ENOUGH = 0.5  # of the clearance, that a probe should read of a push the way in which it grows; else it is pushed the other way
TELLS = 0.3  # of the clearance: what moves a probe by less says nothing of it
ACROSS = 0.3  # of a probe that it does not move
SEEN = 0.3  # of the clearance, that a probe must read of a push
HELD_S = 0.3
ROUNDING = 1e-9
ALIKE = math.cos(math.radians(1.0))


@dataclass(frozen=True)
class Pushed:
    """A push in the direction `angle` rad from y towards z, called `name`; what the radial probes `read` (m) meanwhile."""

    name: str
    angle: float
    read: Mapping[str, float]


def wanted(rig: RigFile) -> tuple[Push, ...]:
    """The pushes that show every probe of which gravity does not say which way it counts; none where it says it of all, and
    none for a probe that no push along it moves."""
    s, out = stations(rig), list[Push]()
    for channel in rings.unshown(rig):
        angle = _way(rig, channel)
        if not any(channel in _shown(rig, _from_y(s, p.angle_rad)) for p in out) and channel in _shown(rig, angle):
            around = s.first.value + s.hand * angle
            out.append(Push(_name(s, channel, angle), around, _zero(rig), _end(rig)))
    return tuple(out)


def count(rig: RigFile) -> int:
    """How many steps `ask` records; none of a rig of other bearings."""
    try:
        return len(wanted(rig))
    except Lacking:
        return 0


def ask(rig: Rig, record: Recorder) -> list[Pushed]:
    """Have the shaft, on its rings, pushed each way and let go; what the probes read. Empty where nobody does it."""
    s, made = stations(rig.file), list[Pushed]()
    for push in wanted(rig.file):
        if not rig.operator.push(push):
            break
        angle = _from_y(s, push.angle_rad)
        with record.step(PUSH, name=push.axis, angle_rad=angle):
            made.append(Pushed(push.axis, angle, first_look.watched(rig, record, s.channels, HELD_S)))
    if made:
        rig.operator.push(None)
    return made


def recorded(recording: Recording[Any]) -> list[Pushed]:
    """Those of the steps."""
    names = stations(recording.rig).channels
    return [Pushed(str(step.labels["name"]), float(step.labels["angle_rad"]), {n: step.mean(n) for n in names})
            for step in recording.steps(PUSH)]  # fmt: skip


def judge(pushes: Sequence[Pushed], rig: RigFile) -> Iterator[Finding]:
    """Probes that read the wrong way, or what was pushed another way; each forbids the lift."""
    least, told = SEEN * least_clearance(rig), set[str]()
    for push in pushes:
        share = leaning.reads(rig, push.angle)
        about = [c for c in _shown(rig, push.angle) if c not in told]
        aside = [c for c in share if abs(share[c]) < ACROSS and abs(push.read[c]) >= least]
        told.update(about)
        moved = [c for c in about if abs(push.read[c]) >= least * abs(share[c])]
        wrong = [c for c in moved if push.read[c] * share[c] < 0]
        read = ", ".join(f"{c} {push.read[c] * 1e6:+.0f} µm" for c in (*about, *aside))
        if len(moved) < len(about) and aside:
            text = (f"the shaft was pushed {push.name}, and not the probes that look there answer, but those across ({read}): "
                    "suspect the readings of two axes exchanged, or a push another way. The shaft was not lifted.")  # fmt: skip
            yield Finding("axes-exchanged", text, about[0], Effect.ERROR)
        elif len(moved) < len(about):
            still = next(c for c in about if c not in moved)
            text = (f"the shaft was pushed {push.name}, where {still} should read {least * abs(share[still]) * 1e6:.0f} µm and "
                    f"more: it reads {push.read[still] * 1e6:+.0f} µm. Push until the shaft touches its rings and hold it "
                    "there; else look at the probe. The shaft was not lifted.")  # fmt: skip
            yield Finding("push-not-seen", text, still, Effect.ERROR)
        elif wrong and len(wrong) == len(about) > 1:
            text = (f"the shaft was pushed {push.name}, and all probes that look there say that it went the other way "
                    f"({read}): either it did, or the polarity of all of them is wrong. The shaft was not "
                    "lifted.")  # fmt: skip
            yield Finding("sensor-polarity", text, wrong[0], Effect.ERROR)
        else:
            for c in wrong:
                text = (f"{c} reads {push.read[c] * 1e6:+.0f} µm while the shaft is pushed {push.name}: the probe's polarity "
                        "is wrong. The shaft was not lifted.")  # fmt: skip
                yield Finding("sensor-polarity", text, c, Effect.ERROR)


def of_recording(recording: Recording[Any]) -> Iterator[Finding]:
    """What pushes showed, and a note on what nothing has shown."""
    made = recorded(recording)
    wrong = list(judge(made, recording.rig))
    yield from wrong
    if not made:
        yield from rings.of_unshown(recording.rig)
    elif not wrong:
        shown = {c for p in made for c in _shown(recording.rig, p.angle)}
        names = ", ".join(c for c in rings.unshown(recording.rig) if c in shown)
        ways = ", then ".join(p.name for p in made)
        yield Finding("polarity-shown", f"pushed by hand {ways}, the shaft shows that {names} count the right way", "")


def _counts(s: Stations, channel: str) -> float:
    """The direction in which the shaft moves where a probe's reading grows, rad from y towards z."""
    p = s.probes[channel]
    return p.angle.value + (0.0 if p.sign > 0 else math.pi)


def _way(rig: RigFile, channel: str) -> float:
    """The direction of a push that shows a probe: in which its reading grows, else the other one, if that shows more."""
    grows = _counts(stations(rig), channel)
    ways = (grows, math.remainder(grows + math.pi, 2 * math.pi))
    one, other = (abs(leaning.reads(rig, way)[channel]) for way in ways)
    return ways[0] if one >= min(ENOUGH, other) else ways[1]


def _shown(rig: RigFile, angle: float) -> tuple[str, ...]:
    """Channels of which a push shows what gravity does not say: as much as most pushes would, or as one along the probe."""
    share = leaning.reads(rig, angle)
    own = {c: abs(leaning.reads(rig, _way(rig, c))[c]) for c in rings.unshown(rig)}
    return tuple(c for c, most in own.items() if abs(share[c]) >= max(min(ABOUT, most) - ROUNDING, TELLS))


def _from_y(s: Stations, around: float) -> float:
    return s.hand * (around - s.first.value)


def _name(s: Stations, channel: str, angle: float) -> str:
    """The direction by the axis that is nearest to it, else by the probe."""
    for name, p in s.axes.items():
        along = math.cos(angle - p.angle.value)
        if abs(along) > ALIKE:
            return f"towards the {'+' if along > 0 else '-'} side of axis {name}"
    grows = math.cos(angle - _counts(s, channel)) > 0
    return f"the way in which {channel} should {'grow' if grows else 'fall'}"


def _zero(rig: RigFile) -> str:
    return "up" if rig.shaft is None else rig.shaft.zero_at


def _end(rig: RigFile) -> str:
    return "far" if rig.shaft is None else rig.shaft.far_end
