"""What a controller of current and position loops can be asked to do: sines into loops, stepped currents, a mover sent along
and around. Bound as `bench.rigfile.capabilities` says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from pydantic import Field

from bench.rigfile.bit import Bit
from bench.rigfile.elements import Name
from bench.rigfile.part import Part
from bench.rigfile.toleranced import Toleranced

InjectionPlace = Literal["sensor", "reference", "force"]


class InjectedLoop(Part):
    """A position loop: `value` of the parameter that chooses it, the `channel` that shows what it holds (of telemetry and of
    captures alike), m or rad. What is told beside it: parameters of its PID `kp`, `ki`, `kd` and of the greatest force that it
    asks for, `limit`, N or N m; what it moves, `share` of the number `inertia`, and the negative `stiffness` that it holds
    against, by their places in this file; the bit that says that it is `limited`; `set_point`, the parameter of where it holds,
    m or rad."""

    value: float
    channel: str
    kp: str = ""
    ki: str = ""
    kd: str = ""
    limit: str = ""
    inertia: str = ""
    share: float = Field(1.0, gt=0)
    stiffness: str = ""
    limited: Bit | None = None
    set_point: str = ""


class LoopInjection(Part):
    """A sine into one position loop: parameter `axis` chooses it by the value that `loops` have, `off` none; `place`, where it
    is added, by the values of `places`: to the reading as the loop has it, to the reference together with its rate, or to the
    force that the loop asks for. `amplitude` m, rad, N or N m; `hz`. `wave`: the channel of captures that has the sine as a
    share of its amplitude, at the sample of the readings that it acts with."""

    axis: str
    off: float = -1.0
    place: str
    places: Mapping[InjectionPlace, float] = Field(min_length=1)
    amplitude: str
    hz: str
    wave: str = ""
    loops: Mapping[Name, InjectedLoop] = Field(min_length=1)


class Motion(Part):
    """A mover that is sent along and around: parameters of its set points, `place` m and `angle` rad, and of what a move goes
    by, `*_rate` m/s, rad/s and `*_rise` m/s^2, rad/s^2; channels that show both, and `currents` of the bearings among those of
    a capture. `gate` m and `gate_time` s: it counts as lifted when every radial probe has read less for so long. `radial`: by
    probe the set point of what it reads, m, at once."""

    place: str
    place_rate: str = ""
    place_rise: str = ""
    place_channel: str
    angle: str
    angle_rate: str = ""
    angle_rise: str = ""
    angle_channel: str
    gate: str = ""
    gate_time: str = ""
    radial: Mapping[Name, str] = {}
    currents: tuple[str, ...] = ()


class HeldAxis(Part):
    """A direction in which a hold pushes: `value` of the parameter that chooses it; of the two planes, in their order, channels
    of captures that read their `positions` and the `currents` that push there, and places of the stated negative `stiffness`,
    N/m. `carried`: the share of the weight of the mass that the controller knows which it adds in each plane beside its
    limit."""

    value: float
    positions: tuple[str, str]
    currents: tuple[str, str]
    stiffness: tuple[str, str]
    carried: float = Field(0.0, ge=0, le=1)


class Hold(Part):
    """Currents of magnetic bearings that the controller keeps at their means, while the shaft leaves its place as the magnets
    pull it; it catches it again by itself. To set the parameter `begin`, s, begins one of so long, at most the greatest value
    of it; `across` chooses a direction by the `value` of `axes`, `push`, A, is put on top of the currents of both planes there;
    a radial reading beyond `bound`, m, ends it. `held`: the channel of captures that is 1 meanwhile. What tells what is caught:
    `limit`, the parameter of the greatest force of a plane and axis, N; the stated `force` of a plane's current, N/A; `mass`,
    the place of that of what is held. `middle`: where its centre of mass is
    in the middle between both planes of probes, by the set point along it."""

    begin: str
    across: str
    push: str
    bound: str
    held: str
    limit: str
    force: Toleranced
    mass: str
    middle: Toleranced | None = None
    axes: Mapping[Name, HeldAxis] = Field(min_length=1)


class CurrentStep(Part):
    """A current that the controller regulates and steps at once. `parameter`, A, is added to its reference; `along` is the
    channel of a capture that reads that current, `across` the one beside it, which is to stay; `currents` and `voltages` those
    of the half-bridges that carry it, before and behind their filters, of a symmetric winding; `supply` that of the DC link,
    half of which a half-bridge can give. `still`: positions and angles that such a step must leave where they are.

    What the controller has of it: parameters `gain` V/A, the proportional one, and `current_limit` A, of `currents`; what the
    machine's table states: `inductance` of the winding and `filter_inductance` of a half-bridge, H."""

    parameter: str
    along: str
    across: str
    voltages: tuple[str, ...] = ()
    currents: tuple[str, ...] = ()
    supply: str = ""
    still: tuple[str, ...] = ()
    gain: str = ""
    current_limit: str = ""
    inductance: str = ""
    filter_inductance: str = ""

    @property
    def captured(self) -> tuple[str, ...]:
        """The channels of a capture of a step at full rate."""
        supply = (self.supply,) if self.supply else ()
        return (self.along, self.across, *self.voltages, *self.currents, *supply)

    @property
    def stated(self) -> tuple[str, ...]:
        """Numbers of `[machine]` that it names."""
        return tuple(name for name in (self.inductance, self.filter_inductance) if name)


class ForceCurrent(Part):
    """The current by which a motor gives force along a loop of `loop_injection`, or torque around; motors of one loop share
    what it asks for. `current` is the channel that reads it, of telemetry and of captures alike; `added`, A, the parameter that
    is added to its reference; `along`, the step of `current_steps` that goes along the field and gives none. `period` is the
    place in this file of a number that says how the current's phase goes with the loop's coordinate: a length has a turn of it,
    a count so many turns of it a turn. `zero`, the parameter that the controller takes for the encoder's zero against that
    phase, rad electrical: the field's phase is the reading's less it. `stated`: what that zero is said to be. `flux`, the
    parameter that has the flux of the nameplate, Wb, whatever it is meant to be of.

    `constant`, N/A or N m/A: what its nameplate says. `cogging`: how many periods of it a turn of the current's phase has (0:
    not told); `feedforward`, N or N m, the parameter by which the controller itself takes off the first harmonic of cogging."""

    loop: str
    current: str
    added: str = ""
    along: str = ""
    period: str
    zero: str = ""
    flux: str = ""
    stated: Toleranced
    constant: Toleranced | None = None
    cogging: int = Field(0, ge=0)
    feedforward: str = ""
