"""The operator: at the other end of a line (automatic, or a simulated rig), or a person at the console."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from bench.clock import Clock
from bench.envelope import Envelope
from bench.errors import OperatorAbort, OperatorRefused
from bench.recorder import Recorder
from bench.roles import Load, Plane, Side


class LineOperator:
    """An operator that answers lines: `hang M2`, `hang -`, `lever left M2`, `lever left -`, `mount ring`, `mount -`,
    `attach inboard KG RAD`, `detach inboard`, `ask TEXT` (see the simulated backend's operators). `may_touch` raises while
    nobody may reach into the machine."""

    def __init__(self, request: Callable[[str], str], clock: Clock, envelope: Envelope) -> None:
        self._request, self._clock, self._envelope = request, clock, envelope
        self.recorder: Recorder | None = None
        self.may_touch: Callable[[], None] = lambda: None

    def hang(self, load: Load) -> None:
        """Have a mass hung in place of what hangs, and wait until it does.

        Raises:
            InterlockError: the mass is beyond the envelope.
            OperatorRefused: the other end cannot do it.
        """
        self._envelope.check_load(load.label)
        self._do(f"hang {load.label or '-'}", f"hang {load.label or 'nothing'}")
        self._note(action="hang", load=load.label)

    def lever(self, side: Side, load: Load) -> None:
        """Have a mass hung on an end of the lever in place of what hangs on it, and wait until it does.

        Raises:
            InterlockError: the mass is beyond the envelope.
            OperatorRefused: the other end cannot do it.
        """
        self._envelope.check_load(load.label)
        self._do(f"lever {side} {load.label or '-'}", f"hang {load.label or 'nothing'} on the lever's {side}")
        self._note(action="lever", side=side, load=load.label)

    def mount(self, part: str) -> None:
        """Have a part put on the shaft, or with "" what is on it taken off.

        Raises:
            OperatorRefused: the other end cannot do it.
        """
        self._do(f"mount {part or '-'}", f"mount {part or 'nothing'}")
        self._note(action="mount", part=part)

    def attach(self, plane: Plane, mass_kg: float, angle_rad: float) -> None:
        """Have a weight fixed in a balancing plane, beside what is there, and wait until it is.

        Raises:
            InterlockError: the weight is beyond the envelope, or the shaft is not landed.
            OperatorRefused: the other end cannot do it.
        """
        self._envelope.check_weight(mass_kg)
        self.may_touch()
        self._do(f"attach {plane} {mass_kg!r} {angle_rad!r}", f"fix {mass_kg * 1e3:g} g in the {plane} plane")
        self._note(action="attach", plane=plane, mass_kg=mass_kg, angle_rad=angle_rad)

    def detach(self, plane: Plane) -> None:
        """Have every weight taken off a balancing plane, and wait until they are.

        Raises:
            InterlockError: the shaft is not landed.
            OperatorRefused: the other end cannot do it.
        """
        self.may_touch()
        self._do(f"detach {plane}", f"take the weights off the {plane} plane")
        self._note(action="detach", plane=plane)

    def _do(self, line: str, what: str) -> None:
        answer = self._request(line).split()
        if not answer or answer[0] != "ok":
            told = " ".join(answer) or "an empty line"
            raise OperatorRefused(f"the operator was asked to {what} and answers {told!r}; expected ok")
        self._clock.sleep(float(answer[1]) if len(answer) > 1 else 0.0)

    def _note(self, **fields: Any) -> None:
        if self.recorder is not None:
            self.recorder.event("operator", **fields)

    def ask(self, question: str) -> str:
        """The answer to a question."""
        answer = self._request(f"ask {question}")
        self._note(action="ask", question=question, answer=answer)
        return answer


class ConsoleOperator:
    """A person at a terminal; what they confirm is passed on to `then` (a simulated rig's line), if there is one."""

    def __init__(
        self, prompt: Callable[[str], str], clock: Clock, envelope: Envelope, then: LineOperator | None
    ) -> None:
        self._prompt, self._clock, self._envelope, self._then = prompt, clock, envelope, then
        self.recorder: Recorder | None = None
        self.may_touch: Callable[[], None] = lambda: None

    def hang(self, load: Load) -> None:
        """Ask for a mass to be hung; the hanger stays on.

        Raises:
            OperatorAbort: the person answered stop.
        """
        self._envelope.check_load(load.label)
        what = f"Hang {load.label} on the hanger" if load.label else "Take every mass off; leave the hanger on"
        self.ask(f"{what}. Press Enter when it hangs still, or type stop: ")
        if self._then is not None:
            self._then.hang(load)

    def lever(self, side: Side, load: Load) -> None:
        """Ask for a mass on an end of the lever, seen from the outboard end; the other end stays empty.

        Raises:
            OperatorAbort: the person answered stop.
        """
        self._envelope.check_load(load.label)
        what = f"Set the lever level and hang {load.label} on its {side} end (seen from outboard), nothing on the other"
        what = what if load.label else "Take every mass off the lever"
        self.ask(f"{what}. Press Enter when it hangs still, or type stop: ")
        if self._then is not None:
            self._then.lever(side, load)

    def mount(self, part: str) -> None:
        """Ask for a part on the shaft, or for everything to be taken off.

        Raises:
            OperatorAbort: the person answered stop.
        """
        what = f"Mount the {part} on the shaft" if part else "Take the ring off the shaft"
        self.ask(f"{what}. Press Enter when it sits, or type stop: ")
        if self._then is not None:
            self._then.mount(part)

    def attach(self, plane: Plane, mass_kg: float, angle_rad: float) -> None:
        """Ask for a weight in a balancing plane, beside what is there.

        Raises:
            InterlockError: the weight is beyond the envelope, or the shaft is not landed.
            OperatorAbort: the person answered stop.
        """
        self._envelope.check_weight(mass_kg)
        self.may_touch()
        where = f"the {plane} balancing plane at {math.degrees(angle_rad) % 360:.1f} deg of its scale"
        self.ask(
            f"The shaft is landed and stands. Weigh out {mass_kg * 1e3:.3f} g and fix it in {where}; leave the other weights "
            "where they are; take tools and hands away. Press Enter when it sits tight, or type stop: "
        )
        if self._then is not None:
            self._then.attach(plane, mass_kg, angle_rad)

    def detach(self, plane: Plane) -> None:
        """Ask for every weight to be taken off a balancing plane.

        Raises:
            InterlockError: the shaft is not landed.
            OperatorAbort: the person answered stop.
        """
        self.may_touch()
        self.ask(
            f"The shaft is landed and stands. Take every weight that was fixed in the {plane} balancing plane off; take tools "
            "and hands away. Press Enter when that is done, or type stop: "
        )
        if self._then is not None:
            self._then.detach(plane)

    def ask(self, question: str) -> str:
        """The person's answer.

        Raises:
            OperatorAbort: the person answered stop.
        """
        answer = self._prompt(question).strip()
        self._clock.sleep(0.01)
        if self.recorder is not None:
            self.recorder.event("operator", question=question, answer=answer)
        if answer.lower() in ("stop", "abort", "quit"):
            raise OperatorAbort(f"the operator answered {answer!r}")
        return answer
