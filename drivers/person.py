"""The operator: a person at the terminal, who is asked, and may say what was really done."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Literal, TypeVar

from bench.clock import Clock
from bench.errors import InterlockError, OperatorAbort
from bench.procedure.roles import NOTHING, Load, Plane, Push, Side
from bench.question import CONSOLE, Answer, Choice, Question
from bench.recording.recorder import Recorder
from bench.rigfile.envelope import Envelope
from drivers.answers import DONE, NO, STOP, YES, Misunderstood, Other, after, degrees_of, reading_of, skipped, unknown
from drivers.operator import LineOperator

T = TypeVar("T")
LANDED = "The shaft is landed and stands."
CLEAR = "take tools and hands away"


class ConsoleOperator:
    """`prompt` shows a question and returns the line that is typed. What is confirmed is passed on to `then` (a simulated rig's
    line), if there is one. `may_touch` raises while nobody may reach into the machine; `approach` makes sure of what holds a
    voltage in it, before a person is asked to touch it, and tells by what; `standing` tells of a machine that is on.
    `attended` is False where nobody is there unless what has to be done asks for somebody."""

    def __init__(
        self, prompt: Callable[[Question], str], clock: Clock, envelope: Envelope, then: LineOperator | None
    ) -> None:
        self._prompt, self._clock, self._envelope, self._then = prompt, clock, envelope, then
        self._hanging: Load | None = None  # on the hanger; None is not known
        self.recorder: Recorder | None = None
        self.attended = True
        self.may_touch: Callable[[], None] = lambda: None
        self.approach: Callable[[], str] = lambda: ""
        self.standing: Callable[[], str] = lambda: ""

    def hang(self, load: Load) -> Load:
        """Ask for a mass to be hung, and return what hangs then; the hanger stays on. Nothing is asked where it hangs already.

        Raises:
            InterlockError: the mass is beyond the envelope.
            OperatorAbort: the person answered stop.
        """
        self._envelope.check_load(load.label)
        if load != self._hanging:
            moved = load.hook and (self._hanging is None or load.hook != self._hanging.hook)
            where = f"Put the hanger on the hook {load.hook}. " if moved else ""
            what = f"Hang {load.label} on the hanger" if load.label else "Take every mass off; leave the hanger on"
            load = self._hanging = replace(self._loaded(where + what, load), hook=load.hook)
        if self._then is not None:
            self._then.hang(load)
        return load

    def lever(self, side: Side, load: Load) -> Load:
        """Ask for a mass on an end of the lever, seen from outboard, the other end empty; return what hangs then.

        Raises:
            InterlockError: the mass is beyond the envelope.
            OperatorAbort: the person answered stop.
        """
        self._envelope.check_load(load.label)
        what = f"Set the lever level and hang {load.label} on its {side} end (seen from outboard), nothing on the other"
        really = self._loaded(what if load.label else "Take every mass off the lever", load)
        if self._then is not None:
            self._then.lever(side, really)
        return really

    def turn(self, angle_rad: float) -> float:
        """Ask for the levitated shaft to be turned by hand to an angle of its scale; return where it stands then, rad.

        Raises:
            OperatorAbort: the person answered stop.
        """
        degrees = math.degrees(angle_rad) % 360
        stands = self._confirmed(
            f"The shaft levitates and stands. Turn it by hand until {degrees:g}° of its scale is at the mark; let it go.",
            "it stands there",
            angle_rad,
            Other("It stands at another angle: type its degrees.", degrees_of),
        )
        if self._then is not None:
            self._then.turn(stands)
        return stands

    def mount(self, part: str) -> None:
        """Ask for a part on the shaft, or for everything to be taken off.

        Raises:
            OperatorAbort: the person answered stop.
        """
        what = f"Mount the {part} on the shaft" if part else "Take the ring off the shaft"
        self._confirmed(f"{what}.", "it sits" if part else "it is off", None, Other())
        if self._then is not None:
            self._then.mount(part)

    def attach(self, plane: Plane, mass_kg: float, angle_rad: float) -> tuple[float, float]:
        """Ask for a weight in a balancing plane, beside what is there; return what was fixed, kg and rad of the plane's scale.

        Raises:
            InterlockError: the weight is beyond the envelope, or the shaft is not landed.
            OperatorAbort: the person answered stop.
        """
        self._envelope.check_weight(mass_kg)
        self.may_touch()
        degrees = math.degrees(angle_rad) % 360
        kg, angle = self._confirmed(
            f"{LANDED} Weigh out {mass_kg * 1e3:.3f} g and fix it in the {plane} balancing plane at {degrees:.1f}° of its "
            f"scale; leave the other weights where they are; {CLEAR}.",
            "it sits tight",
            (mass_kg, angle_rad),
            Other(
                f"Another weight or place: type its grams and degrees, as {mass_kg * 1e3:.3f} {degrees:.0f}.",
                self._weight,
            ),
        )
        if self._then is not None:
            self._then.attach(plane, kg, angle)
        return kg, angle

    def detach(self, plane: Plane) -> None:
        """Ask for every weight to be taken off a balancing plane.

        Raises:
            InterlockError: the shaft is not landed.
            OperatorAbort: the person answered stop.
        """
        self.may_touch()
        what = f"{LANDED} Take every weight that was fixed in the {plane} balancing plane off; {CLEAR}."
        self._confirmed(what, "that is done", None, Other())
        if self._then is not None:
            self._then.detach(plane)

    def push(self, way: Push | None) -> bool:
        """Ask for the landed shaft to be pushed aside and held, or, with None, to be let go; False where the person skips it,
        or nobody is there.

        Raises:
            InterlockError: the shaft is not landed.
            OperatorAbort: the person answered stop.
        """
        if not self.attended:
            return False
        self.may_touch()
        if way is None:
            self._confirmed(f"Let go of the shaft; {CLEAR}.", "that is done", None, Other())
            return self._then is None or self._then.push(None)
        degrees = math.degrees(way.angle_rad) % 360
        counts = f"{degrees:.0f}° from {way.zero}, counter-clockwise seen from outside the {way.end} end"
        done = self._confirmed(
            f"{LANDED} It will be lifted once its probes are known to count the right way. Push it by hand midway "
            f"between its rings {way.axis} ({counts}) until it touches them there, one that lies with about as much as it "
            "weighs, and hold it there.",
            "it is held there", True,
            Other("To leave it out, as it was shown before: type skip.", skipped, (Choice("Leave it out", "skip"),)),
        )  # fmt: skip
        return done and (self._then is None or self._then.push(way))

    def read(self, axis: str, instrument: str, unit: str) -> float:
        """What a reference instrument shows of an axis now, SI: a person types it, in `unit` or with another one of its kind. A
        simulated rig's own operator reads it in its place.

        Raises:
            OperatorAbort: the person answered stop.
        """
        return self._typed(axis, instrument, unit) if self._then is None else self._then.read(axis, instrument, unit)

    def read_cell(self, axis: str, instrument: str, unit: str) -> float:
        """What a load cell that holds an axis shows now, as `read`."""
        return (
            self._typed(axis, instrument, unit) if self._then is None else self._then.read_cell(axis, instrument, unit)
        )

    def wind(self, side: Literal["above", "below"]) -> None:
        """Ask for the load cells that hold the shaft to be wound past their place and back from that side, as `mount` asks."""
        what = (f"Wind the load cells slowly past their place, {'up' if side == 'above' else 'down'} along and around, "
                f"and back to it from {side}: along first, around last.")  # fmt: skip
        self._confirmed(what, "they are at their place", None, Other())
        if self._then is not None:
            self._then.wind(side)

    def _typed(self, axis: str, instrument: str, unit: str) -> float:
        asked = after(self.standing(), f"Read {instrument} of axis {axis}; do not touch the machine.")
        hint = f"Type the number, in {unit} or with its unit; stop ends the run."
        field = f"The number, in {unit} or with its unit"
        answer = self._answer(Question(asked, hint, field=field))
        while (shown := reading_of(answer, unit)) is None:
            answer = self._answer(Question(f"{unknown(answer)}\n{asked}", hint, field=field))
        return shown

    def ask(self, question: str) -> bool:
        """Whether the person says yes.

        Raises:
            OperatorAbort: the person answered stop.
        """
        asked, hint = after(self.standing(), question), "Type yes or no, or stop to end the run."
        buttons = (Choice("Yes", YES[1]), Choice("No", NO[1]))
        answer = self._answer(Question(asked, hint, buttons, field=""))
        while answer not in (*YES, *NO):
            answer = self._answer(Question(f"{unknown(answer)}\n{asked}", hint, buttons, field=""))
        return answer in YES

    def goes_on(self, wrong: str) -> bool:
        """Whether a run goes on that shows something wrong.

        Raises:
            OperatorAbort: the person answered stop.
        """
        return self.ask(f"{wrong}\nThat is an error of this run. Go on all the same?")

    def _loaded(self, what: str, load: Load) -> Load:
        """What hangs after the person was asked for `load`."""
        labels = ", ".join(self._envelope.rig.masses)
        more = (
            f"Another mass hangs: type its label ({labels}, - for none). Another hung in the step before: type was before "
            f"its label, as was {next(iter(self._envelope.rig.masses), '-')}."
        )
        when = "it hangs still" if load.label else "all is still"
        return self._confirmed(f"{what}.", when, load, Other(more, self._mass))

    def _mass(self, answer: str) -> Load | None:
        """The load of an answer, None where it names none. One that hung before is put into the recording, and asks again.

        Raises:
            Misunderstood: no such mass, or none that may hang.
        """
        was, label = answer.startswith("was "), answer.removeprefix("was ").strip()
        masses = {name.lower(): name for name in self._envelope.rig.masses}
        load = NOTHING if label in ("-", "none") else Load(masses[label]) if label in masses else None
        if load is None:
            return None
        try:
            self._envelope.check_load(load.label)
        except InterlockError as error:
            raise Misunderstood(f"{error}.") from error
        if not was:
            return load
        if self.recorder is None or not self.recorder.correct(load=load.label):
            raise Misunderstood("No step with a load was recorded before this one.")
        raise Misunderstood(f"Written down: {load.label or 'nothing'} hung in the step before.")

    def _weight(self, answer: str) -> tuple[float, float] | None:
        """kg and rad of `GRAMS DEGREES`, None where it is not that.

        Raises:
            Misunderstood: a weight beyond the envelope.
        """
        try:
            grams, degrees = (float(word) for word in answer.split())
        except ValueError:
            return None
        if not math.isfinite(degrees):
            return None
        try:
            self._envelope.check_weight(grams * 1e-3)
        except InterlockError as error:
            raise Misunderstood(f"{error}.") from error
        return grams * 1e-3, math.radians(degrees)

    def _confirmed(self, what: str, when: str, asked: T, other: Other[T]) -> T:
        """Make sure that the machine may be touched, and ask until it is done as asked, or the person says what was done
        instead."""
        asks = after(self.approach() or self.standing(), what)
        more = ", ? for more" if other.more else ""
        hint = f"Press Enter when {when}, or type stop to end the run{more}."
        buttons = (Choice(f"Done: {when}", DONE[0]), *other.choices)
        answer = self._answer(Question(asks, hint, buttons, other.more))
        while answer not in DONE:
            try:
                if (really := other.read(answer)) is not None:
                    return really
                why = other.more if answer == "?" else f"{unknown(answer)} {other.more}".rstrip()
            except Misunderstood as error:
                why = str(error)
            answer = self._answer(Question(f"{why}\n{asks}", hint, buttons, other.more))
        return asked

    def _answer(self, question: Question) -> str:
        """What the person answers, in small letters; into the recording with its question and who answered.

        Raises:
            OperatorAbort: stop.
        """
        given = self._prompt(question)
        answer, by = given.strip(), given.by if isinstance(given, Answer) else CONSOLE
        self._clock.sleep(0.01)
        if self.recorder is not None:
            self.recorder.event("operator", question=question, answer=answer, by=by)
        if answer.lower() in STOP:
            raise OperatorAbort(f"the operator answered {answer!r}")
        return answer.lower()
