"""The error tree. A message says what, where, found, expected and the next step.

BenchError
  ConfigError        rig, plan, spec or usage is wrong; nothing was started      exit 2
  LinkError          a link is lost, silent or corrupt                           exit 3
    NoReply          a request was not answered, though it was repeated
    BytesUnreadable  bytes come, but no telemetry can be made of them
    FrozenError      telemetry comes, but its counters stand
    ClockWrong       telemetry comes, but by a clock that is off by a per cent or more
    ReadingsStand    telemetry goes on, but its readings stand
    DeviceUnreadable a register device says what is no number
    OperatorSilent   the operator does not answer
  NotReached         what was told to move did not get there                     exit 3
    StateNotReached  a device took a command and did not go into its state
    RotorNotArrived  the rotor did not reach an angle or a speed
  StateContradicts   the controller's state is none that can be believed         exit 3
  SpeedContradicts   speed channel and angle tell different speeds               exit 3
  Refused            a device answers that it will not                           exit 3
    OperatorRefused  the operator answers that it cannot be done
  RecordingError     a recording cannot be written or read                       exit 3
  AnalysisError      the data do not allow the number                            exit 3
  Aborted            the run was stopped on purpose                              exit 4
    InterlockError   the envelope refused a command or tripped on telemetry
      NotDischarged  a DC link was not seen below the voltage at which people may touch
    DeviceFault      the controller reported a fault
      DriveFault     the drive reported one
    AnotherHost      heartbeats of another host came in
    OperatorAbort    the operator said stop
    SignalAbort      SIGINT, SIGTERM or SIGHUP
    StopAsked        STOP at the live page
"""

from __future__ import annotations

from dataclasses import dataclass


class BenchError(Exception):
    """Root of every error that Levbench raises on purpose; its text is fit for the user."""


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong with an input: where it stands, what was found, what is expected."""

    file: str
    key: str
    found: str
    expected: str

    def __str__(self) -> str:
        return f"{self.file}: {self.key}: found {self.found}; expected {self.expected}"


class ConfigError(BenchError):
    """Rig file, plan, spec or usage is wrong. Carries every problem found, not only the first."""

    def __init__(self, message: str, problems: tuple[Problem, ...] = ()) -> None:
        super().__init__("\n".join([message, *(f"  {p}" for p in problems)]))
        self.problems = problems


class Unfit(ConfigError):
    """A plan that cannot work by what is known of the machine, told before anything starts: `why`."""

    def __init__(self, why: tuple[str, ...]) -> None:
        super().__init__("\n  ".join(["the plan does not fit what is known of the rig; nothing was started:", *why]))
        self.why = why


class Lacking(ConfigError):
    """What a rig does not have, by the tables of its file: `lines`."""

    def __init__(self, *lines: str) -> None:
        super().__init__("; ".join(lines))
        self.lines = lines


class LinkError(BenchError):
    """A link is lost, silent past its timeout, or delivers bytes that cannot be right."""


class NoReply(LinkError):
    """A request was not answered, though it was repeated; telemetry may go on."""


class BytesUnreadable(LinkError):
    """Bytes come, but no telemetry can be made of them."""


class DeviceUnreadable(LinkError):
    """A register device answers with words that are no number."""


class OperatorSilent(LinkError):
    """The operator at the other end of a line does not answer."""


class NotReached(BenchError):
    """What was told to move did not get there; the links are sound."""


class StateNotReached(NotReached):
    """A device took a command and did not go into the state that it leads to."""


class RotorNotArrived(NotReached):
    """The rotor did not reach an angle or a speed."""


class Refused(BenchError):
    """A device answers that it will not do what it was asked for."""


class OperatorRefused(Refused):
    """The operator answers that what was asked for cannot be done."""


class FrozenError(LinkError):
    """Telemetry comes, but its tick or its sequence stands: nobody knows what the machine does."""


class ClockWrong(LinkError):
    """Telemetry comes, but by a clock that is off by a per cent or more: every rate and every time would be wrong."""


class ReadingsStand(LinkError):
    """Telemetry goes on, and all its readings that have noise stand: nobody knows what the machine does."""


class StateContradicts(BenchError):
    """The state that a controller tells contradicts what it was asked for, or what else is seen of the machine."""


class SpeedContradicts(BenchError):
    """The speed that is told and the angle's contradict each other."""


class RecordingError(BenchError):
    """A recording cannot be written, or what is read is not one, is newer, or fails its CRC."""


class AnalysisError(BenchError):
    """The data do not allow the number that was asked for."""


class Aborted(BenchError):
    """The run was stopped on purpose: by the operator, a signal, an interlock or the controller."""


class InterlockError(Aborted):
    """The envelope refused a command (nothing was sent) or tripped on live telemetry."""


class NotDischarged(InterlockError):
    """A DC link was not seen below the voltage at which a person may touch the machine: nobody was asked to."""


class DeviceFault(Aborted):
    """The controller reported a fault."""


class DriveFault(DeviceFault):
    """The drive reported a fault."""


class AnotherHost(Aborted):
    """Another host's heartbeats reach the controller."""


class OperatorAbort(Aborted):
    """The operator said stop."""


class SignalAbort(Aborted):
    """SIGINT, SIGTERM or SIGHUP arrived."""


class StopAsked(SignalAbort):
    """A person asked the run to stop, at its live page."""
