"""The simulated controller that speaks a command line: machine, shell, captures, time. One chunk of time is a reading of the
positions or more; a request acts between two."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Final

from sim_backend.core.plant import Array
from sim_backend.machines.lira.captures import Captures
from sim_backend.machines.lira.plant import FAULTS, POSITION_TICKS, STATES, TICKS_S, WHOLE, Plant
from sim_backend.machines.lira.settings import AXES_OF_LINE, BY_NAME, LONGEST_HOLD_S, MEASUREMENTS, SETTINGS
from sim_backend.machines.lira.shell import PROMPT, Refused, Shell, number, single
from sim_backend.machines.lira.steps import Steps
from sim_backend.machines.lira.streamed import Streamed

RATES: Final = (115_200, 921_600, 3_000_000)
UNSURE_S: Final = 2.0
"""How long it stays at a new rate at which it hears nothing."""
RESTING: Final = ("OFF", "IDLE")
AT_ONCE: Final = ("lift", "land", "stop", "clear", "safe")
BANNER: Final = "lira firmware 1.0"
SWITCHES: Final = ("echo", "prompt", "checksum", "event")
SWITCHED: Final = {"checksum": "checksums", "event": "events"}
COLUMNS: Final = {m.name: (m, WHOLE.index(m.column)) for m in MEASUREMENTS}


class Device:
    """The machine behind its command line.

    Args:
        plant: the machine with its loops.
        serial: number that `id` tells.
    """

    def __init__(self, plant: Plant, serial: str = "SIM-0018") -> None:
        self.plant = plant
        self.shell = Shell(self)
        self.baud = RATES[0]
        self._unsure: int | None = None  # tick of the machine at which a rate is given up
        self._serial = serial
        self._started, self._beat = 0, ""
        self._rows: Array = plant.run(1 / 35000, whole=True)
        self._told = (plant.state, plant.fault)
        self._holding = False
        self._steps = Steps(plant)
        self._captures = Captures()
        self.streamed = Streamed()
        """Slow telemetry: blocks that wait to be sent."""
        self._verbs: dict[str, Callable[..., Iterable[str | bytes]]] = {
            "id": self._id, "stat": self._stat, "meas": self._meas, "list": self._list, "get": self._get, "set": self._set,
            "default": self._default, "save": self._save, "on": self._on, "ref": self._ref, "halt": self._halt,
            "step": self._step, "inj": self._inj, "hold": self._hold, "hb": self._hb, "stream": self.streamed.do,
            "baud": self._baud, "cap": self._captures.do,
        }  # fmt: skip
        self._verbs |= {name: self._switch(name) for name in SWITCHES}
        self._verbs |= {name: self._command(name) for name in AT_ONCE}
        self._factory = {s.name: float(plant.get(s.field)) for s in SETTINGS}
        self._saved = dict(self._factory)

    @property
    def tick(self) -> int:
        """Ticks of 1/280 000 s since the firmware started."""
        return self.plant.tick - self._started

    @property
    def verbs(self) -> tuple[str, ...]:
        """What it can be asked."""
        return tuple(self._verbs)

    def advance(self, seconds: float) -> bytes:
        """Let time pass; the events of it."""
        left = round(seconds * TICKS_S) // POSITION_TICKS * POSITION_TICKS
        while left > 0:
            if self._unsure is not None and self.plant.tick >= self._unsure:
                self.baud, self._unsure = RATES[0], None
            ticks = min(left, TICKS_S // 1000, self._steps.ended())
            capture = self._captures.running
            at = self.tick
            every = capture.every if capture else POSITION_TICKS
            self._rows = self.plant.run(ticks / TICKS_S, every, whole=True)
            self.streamed.take(self._rows, at, every)
            if capture is not None:
                capture.take(self._rows, at)
                if capture.full:
                    self.shell.tell(self.tick, "capture", f"{capture.number} done")
            self._watch()
            left -= ticks
        return self.shell.told()

    def restart(self, why: str) -> bytes:
        """As after power-on: OFF, with the settings that were saved, nothing captured, nothing streamed, a person's line. The
        machine goes on as it is, without currents; what the firmware says."""
        self.plant.power_on()
        self._started = self.plant.tick
        self._steps.forget()
        self._put(self._saved)
        later, self.shell = self.shell.later, Shell(self)
        self.shell.later = later
        if later is not None:
            later.clear()
        self.baud, self._unsure = RATES[0], None
        self._captures.forget()
        self.streamed.end()
        self._told = (self.plant.state, self.plant.fault)
        self.shell.tell(0, "boot", why)
        return f"{BANNER}\r\n".encode("ascii") + self.shell.told() + PROMPT.encode("ascii")

    def do(self, words: tuple[str, ...]) -> Iterable[str | bytes]:
        """Carry out a request.

        Raises:
            Refused: it cannot be done; with its code.
        """
        self._unsure = None
        verb = self._verbs.get(words[0])
        if verb is None:
            raise Refused(1, words[0])
        return verb(*words[1:])

    def _watch(self) -> None:
        now = (self.plant.state, self.plant.fault)
        if now[0] != self._told[0]:
            self.shell.tell(self.tick, "state", now[0])
        if now[1] != self._told[1] and now[1] != FAULTS[0]:
            self.shell.tell(self.tick, "fault", now[1])
        self._told = now
        if self._holding and not self.plant.held:
            self.shell.tell(self.tick, "hold", "bound" if self.plant.hold_left_bound else "over")
        self._holding = self.plant.held

    def _switch(self, field: str) -> Callable[..., Iterable[str]]:
        def switch(*words: str) -> Iterable[str]:
            if len(words) != 1 or words[0] not in ("on", "off"):
                raise Refused(2, "on|off")
            setattr(self.shell, SWITCHED.get(field, field), words[0] == "on")
            return [words[0]]

        return switch

    def _command(self, name: str) -> Callable[..., Iterable[str]]:
        def command(*words: str) -> Iterable[str]:
            if words:
                raise Refused(2, "none")
            return self._commanded(name)

        return command

    def _commanded(self, name: str) -> Iterable[str]:
        refused = self.plant.command(name)
        if refused:
            raise Refused(4, f"state={self.plant.state}" if refused == 1 else "the mover stands too far off the middle")
        self._watch()
        return [self.plant.state]

    def _id(self) -> Iterable[str]:
        return [f"model=lira serial={self._serial} fw=1.0 map=1 protocol=1 simulated=yes"]

    def _stat(self) -> Iterable[str]:
        row = dict(zip(WHOLE, self._rows[-1], strict=True))
        state = f"state={self.plant.state} fault={self.plant.fault}"
        return [f"tick={self.tick} {state} sat={int(row['limited'])} udc={row['u_dc']:.9g}"]

    def _meas(self, *words: str) -> Iterable[str]:
        names = tuple(COLUMNS) if words == ("all",) else words
        if not names or any(n not in COLUMNS for n in names):
            raise Refused(2, "name.. or all")
        row = self._rows[-1]
        told = [f"{n}={row[COLUMNS[n][1]]:.9g} {COLUMNS[n][0].unit}" for n in names]
        return [f"tick={self.tick}", *told] if len(told) > 1 else [f"tick={self.tick} {told[0]}"]

    def _list(self, *words: str) -> Iterator[str]:
        if words == ("par",):
            yield from (
                f"{k} {s.name} {s.unit} f32 1 {s.low:.9g} {s.high:.9g} {self._factory[s.name]:.9g}"
                for k, s in enumerate(SETTINGS)
            )
            yield f"{len(SETTINGS)}"
        elif words == ("chan",):
            yield from (f"{k} {m.name} {m.unit} i16 {m.lsb:.9g}" for k, m in enumerate(MEASUREMENTS))
            yield f"{len(MEASUREMENTS)}"
        else:
            raise Refused(2, "par|chan")

    def _get(self, *words: str) -> Iterable[str]:
        if len(words) != 1 or words[0] not in BY_NAME:
            raise Refused(2, "name")
        s = BY_NAME[words[0]]
        return [f"{s.name}={self.plant.get(s.field):.9g} {s.unit}"]

    def _set(self, *words: str) -> Iterable[str]:
        if len(words) != 2 or words[0] not in BY_NAME:
            raise Refused(2, "name value")
        s = BY_NAME[words[0]]
        value = single(number(words[1]))
        if not s.low <= value <= s.high:
            raise Refused(3, f"{s.name} {s.low:.9g}..{s.high:.9g}")
        self.plant.set(s.field, value)
        return self._get(s.name)

    def _default(self) -> Iterable[str]:
        self._resting()
        self._put(self._factory)
        return []

    def _put(self, values: Mapping[str, float]) -> None:
        for s in SETTINGS:
            self.plant.set(s.field, values[s.name])

    def _save(self) -> Iterable[str]:
        """What is set now is set at the next start, too."""
        self._resting()
        self._saved = {s.name: self.plant.get(s.field) for s in SETTINGS}
        return []

    def _resting(self) -> None:
        if self.plant.state not in RESTING:
            raise Refused(4, f"state={self.plant.state}")

    def _on(self, *words: str) -> Iterable[str]:
        if words != ("current",):
            raise Refused(2, "current")
        if self.plant.state == STATES[0]:
            self._commanded("idle")
        return self._commanded("on")

    def _ref(self, *words: str) -> Iterable[str]:
        if len(words) not in (2, 4) or words[0] not in AXES_OF_LINE:
            raise Refused(2, "x1|x2|y1|y2|z|gamma value [rate accel]")
        if self.plant.state in RESTING or self.plant.state == STATES[-1]:
            raise Refused(4, f"state={self.plant.state}")
        value, *rates = (number(w) for w in words[1:])
        low, high = {"z": (-1e-3, 20e-3), "gamma": (-math.inf, math.inf)}.get(words[0], (-50e-6, 50e-6))
        if not low <= value <= high or any(r < 0 for r in rates):
            raise Refused(3, f"{words[0]} {low:.9g}..{high:.9g}")
        self.plant.go(AXES_OF_LINE[words[0]], value, *(rates if all(rates) else ()))
        return [f"{words[0]}={value:.9g}"]

    def _step(self, *words: str) -> Iterable[str]:
        told = self._steps.do(*words)
        self._captures.stepped()
        return told

    def _inj(self, *words: str) -> Iterable[str]:
        if words == ("off",):
            self.plant.set("inject_axis", -1.0)
            return ["off"]
        places = {"sensor": 0.0, "ref": 1.0, "force": 2.0}
        if len(words) != 4 or words[0] not in AXES_OF_LINE or words[1] not in places:
            raise Refused(2, "axis sensor|ref|force amplitude hz, or off")
        amplitude, hz = number(words[2]), number(words[3])
        if not 0 < hz < 17_500:
            raise Refused(3, "hz 0..17500")
        for name, value in (("inject_place", places[words[1]]), ("inject_amplitude", amplitude), ("inject_hz", hz),
                            ("inject_axis", float(tuple(AXES_OF_LINE).index(words[0])))):  # fmt: skip
            self.plant.set(name, value)
        return [f"{words[0]} {words[1]} {amplitude:.9g} {hz:.9g}"]

    def _hold(self, *words: str) -> Iterable[str]:
        """The bearings' currents stay, those along x or y pushed, until the time is over or a reading leaves the bound."""
        if len(words) != 3 or words[0] not in ("x", "y"):
            raise Refused(2, "x|y amperes seconds")
        amperes, seconds = number(words[1]), number(words[2])
        if not -2 <= amperes <= 2 or not 0 <= seconds <= LONGEST_HOLD_S:
            raise Refused(3, f"-2..2 A, 0..{LONGEST_HOLD_S:g} s")
        if self.plant.hold(words[0], amperes, seconds):
            raise Refused(4, f"state={self.plant.state}")
        self._holding = self.plant.held
        return [f"hold={seconds:.9g} s {words[0]} {amperes:.9g} A"]

    def _halt(self, *words: str) -> Iterable[str]:
        """Angle and z stay where they come to rest when they are braked now."""
        if words:
            raise Refused(2, "none")
        for axis, speed, rise in (("z", 0.5, 40.0), ("angle", 18.0, 300.0)):
            at, rate = self.plant.set_point(axis)
            self.plant.go(axis, at + rate * abs(rate) / (2 * rise), speed, rise)
        return [self.plant.state]

    def _hb(self, *words: str) -> Iterable[str]:
        if len(words) != 1 or not words[0].isdigit():
            raise Refused(2, "counter")
        if words[0] != self._beat:  # one that stands still says nothing of its host
            self.plant.beat()
        self._beat = words[0]
        return [words[0]]

    def _baud(self, *words: str) -> Iterable[str]:
        """Only at rest: the way back from a rate that was not understood outlasts the watchdog."""
        self._resting()
        if len(words) != 1 or not words[0].isdigit() or int(words[0]) not in RATES:
            raise Refused(2, "|".join(map(str, RATES)))
        self.baud = int(words[0])
        self._unsure = self.plant.tick + round(UNSURE_S * TICKS_S)
        return [words[0]]
