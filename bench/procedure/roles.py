"""Roles: what a device can do for a procedure. Drivers implement them; procedures ask the rig for them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal, Protocol

from bench.rigfile.capture import NOW, CaptureData, Trigger


class RigState(StrEnum):
    """Where the rig stands. Transitions between them live in `bench.procedure.states` and nowhere else."""

    OFF = "OFF"
    READY = "READY"
    LEVITATED = "LEVITATED"
    SPINNING = "SPINNING"
    HELD = "HELD"  # of a machine that does not levitate: its axes are held where they were sent
    MOVING = "MOVING"


@dataclass(frozen=True, slots=True)
class Load:
    """What hangs on the hook besides the hanger, or on the lever: a label of the rig file's `masses` table, or nothing."""

    label: str  # "" is nothing
    hook: str = ""  # of the rig file; "": its only one


NOTHING = Load("")


@dataclass(frozen=True, slots=True)
class Push:
    """A push of the shaft that is not lifted, by hand: `axis` says it by the rig file's names, `angle_rad` counts around the
    shaft from `zero`, counter-clockwise for who looks at the `end` from outside."""

    axis: str
    angle_rad: float
    zero: str
    end: str


Side = Literal["left", "right"]
"""An end of the lever, seen from its outboard end: a weight on the left turns the shaft forward."""
Plane = str
"""A balancing plane, by the rig file's name."""


class Levitation(Protocol):
    """The device that holds the rotor. Every call returns when the controller reports the state, or raises."""

    @property
    def state(self) -> RigState: ...
    def enable(self) -> None: ...  # OFF -> READY
    def levitate(self) -> None: ...  # READY -> LEVITATED
    def lift(self) -> None: ...  # READY -> lifting; waits for no end: it may take what a procedure has yet to do
    def land(self) -> None: ...  # LEVITATED -> READY
    def disable(self) -> None: ...  # READY -> OFF
    def set(self, parameter: str, value: float) -> None: ...  # SI; passes the envelope; read back
    def write(self, values: Mapping[str, float]) -> None: ...  # as `set`; those of one message in one message
    def get(self, parameter: str) -> float: ...  # SI
    def reading(
        self, channel: str
    ) -> float: ...  # newest sample, SI: for deciding whether to go on, never for a result


class Rotation(Protocol):
    """The device that turns the rotor."""

    @property
    def speed_rad_s(self) -> float: ...
    def point(self, angle_rad: float) -> None: ...  # returns when the rotor stands at that angle
    def spin(self, rad_s: float) -> None: ...  # returns when the rotor turns at that speed
    def stop(self) -> None: ...  # returns when the rotor is below the landing speed


class Motion(Protocol):
    """The device that positions the axes of a machine that does not levitate. Every call returns when the controller reports
    the state, or raises. `set`, `write`, `get` and `reading` as those of `Levitation`."""

    @property
    def state(self) -> RigState: ...
    def enable(self) -> None: ...  # OFF -> READY
    def home(self) -> None: ...  # READY -> READY with zeros that are known; nothing where they are
    def hold(self) -> None: ...  # READY -> HELD, where it stands
    def let_go(self) -> None: ...  # HELD -> READY: without currents
    def disable(self) -> None: ...  # READY -> OFF
    def move(
        self, targets: Mapping[str, float]
    ) -> None: ...  # HELD: by axis, m or rad; returns when set points rest there
    def play(self) -> None: ...  # HELD -> MOVING: waves that are set begin
    def stop(self) -> None: ...  # MOVING -> HELD: set points brake to rest
    def set(self, parameter: str, value: float) -> None: ...
    def write(self, values: Mapping[str, float]) -> None: ...
    def get(self, parameter: str) -> float: ...
    def reading(self, channel: str) -> float: ...


class Operator(Protocol):
    """A person, or what stands in for one."""

    def hang(self, load: Load) -> Load: ...  # the hanger stays on; returns when done, with what hangs
    def lever(
        self, side: Side, load: Load
    ) -> Load: ...  # on an end of the level lever, the other end empty; what hangs
    def mount(self, part: str) -> None: ...  # "ring" on the shaft; "" takes it off
    def attach(
        self, plane: Plane, mass_kg: float, angle_rad: float
    ) -> tuple[float, float]: ...  # a weight beside what is there; kg and rad of what was fixed; angle
    # on the plane's scale, counted from y towards z while its zero faces y; the shaft must be landed
    def detach(self, plane: Plane) -> None: ...  # every weight of that plane; the shaft must be landed
    def turn(
        self, angle_rad: float
    ) -> float: ...  # the shaft, by hand, to that angle of its scale; where it stands then
    def push(
        self, way: Push | None
    ) -> (
        bool
    ): ...  # the landed shaft, aside until it touches; returns while it is held; None: let go; False: nobody does
    def read(
        self, axis: str, instrument: str, unit: str
    ) -> float: ...  # what an instrument shows now, SI; its usual unit
    def read_cell(
        self, axis: str, instrument: str, unit: str
    ) -> float: ...  # likewise, what a load cell of an axis shows
    def wind(
        self, side: Literal["above", "below"]
    ) -> None: ...  # the load cells that hold the shaft, past their place on that side and back to it
    def ask(self, question: str) -> bool: ...  # yes or no
    def goes_on(self, wrong: str) -> bool: ...  # whether a run goes on that shows this; where nobody is, it does not


class Drive(Protocol):
    """An external drive that turns the shaft. Every call returns when the drive reports what was asked, or raises."""

    @property
    def speed_rad_s(self) -> float: ...  # as the drive measures it
    @property
    def fault(self) -> str: ...  # its name, "" without one
    @property
    def running(self) -> bool: ...  # it gives torque
    def confirm_off(self) -> bool: ...  # a reading made now says: no torque; raises nothing
    def let_go(self) -> None: ...  # sends coast, waits for nothing and raises nothing
    def set_speed(self, rad_s: float) -> None: ...  # passes the envelope; takes effect while it runs
    def set_acceleration(self, rad_s2: float) -> None: ...  # towards a speed; 0: as fast as it does by itself
    def run(self) -> None: ...  # it gives torque; the speed follows
    def reach(self, rad_s: float, patience_s: float = 25.0) -> None: ...
    # set_speed, run, at its own acceleration; returns at that speed, gives up where it comes no nearer for so long
    def coast(self) -> None: ...  # no torque
    def brake(self) -> None: ...  # begins to brake; returns when it was told
    def stop(self) -> None: ...  # brakes; returns at standstill


class Capture(Protocol):
    """What records inside the controller, at its full rate, and uploads. One capture at a time."""

    @property
    def channels(self) -> tuple[str, ...]: ...  # what it can record
    @property
    def memory_bytes(self) -> int: ...
    @property
    def rate_hz(self) -> float: ...  # the highest
    def arm(
        self, channels: Sequence[str], *, seconds: float, before_s: float = 0.0, rate_hz: float | None = None,
        trigger: Trigger = NOW,
    ) -> None: ...  # `seconds` in all, `before_s` of them before the trigger; refuses more than memory_bytes  # fmt: skip
    def wait(self, timeout_s: float) -> None: ...  # returns when it is recorded
    def upload(
        self, progress: Callable[[int, int], None] | None = None, **labels: str | float
    ) -> CaptureData: ...  # into the recording, as stream capture/1, capture/2 ...; progress: bytes so far, and in all
    def cancel(self) -> None: ...  # gives up what is armed or recorded


class Supply(Protocol):
    """The power supply of the amplifiers."""

    @property
    def voltage_V(self) -> float: ...
    @property
    def current_A(self) -> float: ...
    @property
    def on(self) -> bool: ...


class Thermal(Protocol):
    """What measures temperatures."""

    @property
    def temperatures_K(self) -> Mapping[str, float]: ...  # of the windings, by name
    @property
    def ambient_K(self) -> float: ...
