"""The operator at the other end of a line: automatic, or a simulated rig's."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

from bench.clock import Clock
from bench.errors import OperatorRefused
from bench.procedure.roles import Load, Plane, Push, Side
from bench.recording.recorder import Recorder
from bench.rigfile.envelope import Envelope
from drivers.answers import reading_of


class LineOperator:
    """An operator that answers lines: `hang M2`, `hang -`, `hang HOOK M2`, `turn DEGREES`, `push DEGREES`,
    `push -`, `lever left M2`, `lever left -`, `mount ring`, `mount -`,
    `attach inboard KG RAD`, `detach inboard`, `read AXIS`, `cell AXIS`, `wind above`,
    `ask TEXT` (see the simulated backend's operators). `may_touch` raises while
    nobody may reach into the machine; `approach` makes sure of what holds a voltage in it, before anything is asked for, and
    tells by what."""

    def __init__(self, request: Callable[[str], str], clock: Clock, envelope: Envelope) -> None:
        self._request, self._clock, self._envelope = request, clock, envelope
        self.recorder: Recorder | None = None
        self.may_touch: Callable[[], None] = lambda: None
        self.approach: Callable[[], str] = lambda: ""
        self.standing: Callable[[], str] = lambda: ""

    def hang(self, load: Load) -> Load:
        """Have a mass hung in place of what hangs, and wait until it does.

        Raises:
            InterlockError: the mass is beyond the envelope.
            OperatorRefused: the other end cannot do it.
        """
        self._envelope.check_load(load.label)
        where = f"{load.hook} " if load.hook else ""
        self._do(f"hang {where}{load.label or '-'}", f"hang {load.label or 'nothing'}")
        self._note(action="hang", load=load.label, **({"hook": load.hook} if load.hook else {}))
        return load

    def lever(self, side: Side, load: Load) -> Load:
        """Have a mass hung on an end of the lever in place of what hangs on it, and wait until it does.

        Raises:
            InterlockError: the mass is beyond the envelope.
            OperatorRefused: the other end cannot do it.
        """
        self._envelope.check_load(load.label)
        self._do(f"lever {side} {load.label or '-'}", f"hang {load.label or 'nothing'} on the lever's {side}")
        self._note(action="lever", side=side, load=load.label)
        return load

    def turn(self, angle_rad: float) -> float:
        """Have the shaft turned by hand to an angle of its scale, and wait until it stands there.

        Raises:
            OperatorRefused: the other end cannot do it.
        """
        self._do(f"turn {math.degrees(angle_rad)!r}", f"turn the shaft to {math.degrees(angle_rad):g}°")
        self._note(action="turn", angle_rad=angle_rad)
        return angle_rad

    def mount(self, part: str) -> None:
        """Have a part put on the shaft, or with "" what is on it taken off.

        Raises:
            OperatorRefused: the other end cannot do it.
        """
        self._do(f"mount {part or '-'}", f"mount {part or 'nothing'}")
        self._note(action="mount", part=part)

    def attach(self, plane: Plane, mass_kg: float, angle_rad: float) -> tuple[float, float]:
        """Have a weight fixed in a balancing plane, beside what is there, and wait until it is.

        Raises:
            InterlockError: the weight is beyond the envelope, or the shaft is not landed.
            OperatorRefused: the other end cannot do it.
        """
        self._envelope.check_weight(mass_kg)
        self.may_touch()
        self._do(f"attach {plane} {mass_kg!r} {angle_rad!r}", f"fix {mass_kg * 1e3:g} g in the {plane} plane")
        self._note(action="attach", plane=plane, mass_kg=mass_kg, angle_rad=angle_rad)
        return mass_kg, angle_rad

    def detach(self, plane: Plane) -> None:
        """Have every weight taken off a balancing plane, and wait until they are.

        Raises:
            InterlockError: the shaft is not landed.
            OperatorRefused: the other end cannot do it.
        """
        self.may_touch()
        self._do(f"detach {plane}", f"take the weights off the {plane} plane")
        self._note(action="detach", plane=plane)

    def push(self, way: Push | None) -> bool:
        """Have the landed shaft pushed aside and held, or with None let go; False where the other end does not do such.

        Raises:
            InterlockError: the shaft is not landed.
        """
        self.may_touch()
        line = "push -" if way is None else f"push {math.degrees(way.angle_rad)!r}"
        try:
            self._do(line, "let go of the shaft" if way is None else f"push the shaft {way.axis}")
        except OperatorRefused:
            return False
        self._note(action="push", **({"axis": way.axis, "angle_rad": way.angle_rad} if way is not None else {}))
        return True

    def read(self, axis: str, instrument: str, unit: str) -> float:
        """What a reference instrument shows of an axis now, SI; the other end answers `ok SECONDS NUMBER UNIT`, in a unit of
        that kind.

        Raises:
            OperatorRefused: the other end cannot do it, or answers something else.
        """
        return self._read(f"read {axis}", "read", axis, instrument, unit)

    def read_cell(self, axis: str, instrument: str, unit: str) -> float:
        """What a load cell that holds an axis shows now, SI, as `read`.

        Raises:
            OperatorRefused: the other end cannot do it, or answers something else.
        """
        return self._read(f"cell {axis}", "read-cell", axis, instrument, unit)

    def wind(self, side: Literal["above", "below"]) -> None:
        """Have the load cells that hold the shaft wound past their place and back to it from that side, and wait until they
        are.

        Raises:
            OperatorRefused: the other end cannot do it.
        """
        self._do(f"wind {side}", f"wind the load cells to their place from {side}")
        self._note(action="wind", side=side)

    def _read(self, line: str, action: str, axis: str, instrument: str, unit: str) -> float:
        answer = self._request(line)
        shown = (
            reading_of(answer.split(maxsplit=2)[2], unit)
            if answer.startswith("ok ") and answer.count(" ") >= 2
            else None
        )
        if shown is None:
            told = answer.strip() or "an empty line"
            what = f"the operator was asked to read {instrument} of axis {axis}"
            raise OperatorRefused(f"{what} and answers {told!r}; expected ok SECONDS NUMBER UNIT")
        self._clock.sleep(float(answer.split()[1]))
        self._note(action=action, axis=axis, value=shown)
        return shown

    def _do(self, line: str, what: str) -> None:
        if (seen := self.approach()) and self.recorder is not None:
            self.recorder.event("approach", seen=seen)
        answer = self._request(line).split()
        if not answer or answer[0] != "ok":
            told = " ".join(answer) or "an empty line"
            raise OperatorRefused(f"the operator was asked to {what} and answers {told!r}; expected ok")
        self._clock.sleep(float(answer[1]) if len(answer) > 1 else 0.0)

    def _note(self, **fields: Any) -> None:
        if self.recorder is not None:
            self.recorder.event("operator", **fields)

    def ask(self, question: str) -> bool:
        """Whether the answer to a question is yes."""
        answer = self._request(f"ask {question}")
        self._note(action="ask", question=question, answer=answer)
        return answer.strip().lower() in ("yes", "y")

    def goes_on(self, wrong: str) -> bool:
        """Whether a run goes on that shows something wrong: nobody is there to look after it, so no."""
        self._note(action="goes-on", question=wrong, answer="no")
        return False
