"""What a controller of a machine that does not levitate can be asked to do: axes that are sent somewhere, phases that carry a
current by themselves. Bound as `bench.rigfile.capabilities` says; axes are the rig file's encoders."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from pydantic import Field

from bench.rigfile.bit import Bit
from bench.rigfile.elements import Name
from bench.rigfile.part import Part

AXIS_PARAMETERS = ("target", "rate", "rise", "stiffness", "integral", "damping", "limit")
AXIS_CHANNELS = ("reference", "asked", "given", "speed")
WAVE_PARAMETERS = ("kind", "amplitude", "period", "phase")
TEST_PARAMETERS = ("phase", "current", "pulse")


class Wave(Part):
    """A set point that goes to and fro by itself, about where it was sent, from the command MOVE on: parameter `kind` chooses
    it by the values `off`, `sine` and `square`; `amplitude` m or rad, `period` s, `phase` turns."""

    kind: str
    off: float = 0.0
    sine: float | None = None
    square: float | None = None
    amplitude: str
    period: str
    phase: str = ""


class PositionedAxis(Part):
    """An axis that is held where it is sent, m and N, or rad and N m. Parameters: `target`, of which the limits are the travel,
    `rate` and `rise`, by which the set point goes there (a rate of 0: at once); of the loop `stiffness` N/m, `integral`
    N/(m s), `damping` N s/m and `limit`, the greatest force that it asks for. Channels: `reference`, the set point; `asked`,
    the force that the loop asks for; `given`, what the controller gives by its own map; `speed`, the axis' rate as the
    controller has it."""

    target: str
    rate: str = ""
    rise: str = ""
    stiffness: str = ""
    integral: str = ""
    damping: str = ""
    limit: str = ""
    reference: str = ""
    asked: str = ""
    given: str = ""
    speed: str = ""
    wave: Wave | None = None


class Positioning(Part):
    """Axes by the names of encoders. `homed`: the bit that says that their zeros are known; without one they are looked for
    each time that the machine is to be held. `home_time`: the longest that takes, s. `loop_s`: period of the loops, at whose
    ticks set points start. `make_safe`: whether a machine that was made safe is without currents or held where it came to rest.
    """

    axes: Mapping[Name, PositionedAxis] = Field(min_length=1)
    homed: Bit | None = None
    home_time: float = Field(60.0, gt=0)
    loop_s: float = Field(0.0, ge=0)
    make_safe: Literal["let go", "hold"] = "let go"


class PhaseTest(Part):
    """Phases of a motor that carry a current one at a time, in READY: parameter `phase` chooses one by the value that `phases`
    have, `off` none; `current` A that it is given; `pulse` s: to set it, with `current` 0, applies the whole supply to that
    phase up to the current limit, holds that until so long is over, and applies the opposite until no current is left.
    `voltages` and `currents`: by phase the channels of captures."""

    phase: str
    phases: Mapping[Name, float] = Field(min_length=1)
    off: float
    current: str = ""
    pulse: str = ""
    voltages: Mapping[Name, str] = {}
    currents: Mapping[Name, str] = {}
