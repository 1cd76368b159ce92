"""The operator: at the other end of a line (automatic, or a simulated rig), or a person at the console."""

from __future__ import annotations

from collections.abc import Callable

from bench.clock import Clock
from bench.envelope import Envelope
from bench.errors import BenchError, OperatorAbort
from bench.recorder import Recorder
from bench.roles import Load


class LineOperator:
    """An operator that answers lines: `hang M2`, `hang -`, `ask TEXT` (see the simulated backend's endpoint)."""

    def __init__(self, request: Callable[[str], str], clock: Clock, envelope: Envelope) -> None:
        self._request, self._clock, self._envelope = request, clock, envelope
        self.recorder: Recorder | None = None

    def hang(self, load: Load) -> None:
        """Have a mass hung in place of what hangs, and wait until it does.

        Raises:
            InterlockError: the mass is beyond the envelope.
            BenchError: the other end cannot do it.
        """
        self._envelope.check_load(load.label)
        answer = self._request(f"hang {load.label or '-'}").split()
        if not answer or answer[0] != "ok":
            raise BenchError(f"the operator cannot hang {load.label or 'nothing'}: {' '.join(answer)}")
        self._clock.sleep(float(answer[1]) if len(answer) > 1 else 0.0)
        if self.recorder is not None:
            self.recorder.event("operator", action="hang", load=load.label)

    def ask(self, question: str) -> str:
        """The answer to a question."""
        answer = self._request(f"ask {question}")
        if self.recorder is not None:
            self.recorder.event("operator", action="ask", question=question, answer=answer)
        return answer


class ConsoleOperator:
    """A person at a terminal; what they confirm is passed on to `then` (a simulated rig's line), if there is one."""

    def __init__(
        self, prompt: Callable[[str], str], clock: Clock, envelope: Envelope, then: LineOperator | None
    ) -> None:
        self._prompt, self._clock, self._envelope, self._then = prompt, clock, envelope, then
        self.recorder: Recorder | None = None

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
