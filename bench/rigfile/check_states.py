"""What is wrong with what a rig file says of the controller's own words: names of states, and those that mean no fault."""

from __future__ import annotations

from collections.abc import Iterator

from bench.rigfile.binding import MODES
from bench.rigfile.check_binding import KEY, Found, signal_at
from bench.rigfile.messages import MessageMap
from bench.rigfile.model import RigFile
from bench.rigfile.stage import is_stage

GOALS = ("OFF", "READY", "LEVITATED", "FAULT")
"""What no run can do without: a state for each."""
STAGE_GOALS = ("OFF", "READY", "HOLDING", "FAULT")
"""And where nothing levitates."""


def problems_of(rig: RigFile, messages: MessageMap) -> Iterator[Found]:
    """Key, found and expected of every state without a meaning, of meanings without a state, and of names for no fault."""
    yield from _states(rig, messages)
    yield from _faults(rig, messages)


def _goals(rig: RigFile) -> tuple[str, ...]:
    return STAGE_GOALS if is_stage(rig) else GOALS


def _states(rig: RigFile, messages: MessageMap) -> Iterator[Found]:
    channel = rig.channels.get("state")
    signal = None if channel is None else signal_at(messages, channel.signal)
    if channel is None or signal is None:
        return
    meant = set()
    for state in signal.choices.values():
        mode = rig.binding.mode(state)
        meant.add(mode)
        if mode is None:
            yield f"{KEY}.states.{state}", "nothing", f"what {state} amounts to: one of {', '.join(MODES)}"
    for state in rig.binding.states:
        if state not in signal.choices.values():
            known = ", ".join(signal.choices.values()) or "none"
            yield f"{KEY}.states.{state}", "a state that the controller does not have", f"one of {known}"
    if None not in meant and (missing := [m for m in _goals(rig) if m not in meant]):
        yield (
            f"{KEY}.states",
            f"no state that amounts to {', '.join(missing)}",
            f"VAL_ of {channel.signal} that names it",
        )


def _faults(rig: RigFile, messages: MessageMap) -> Iterator[Found]:
    """A controller without a fault must not be taken for one that reports its name for that."""
    channel, b = rig.channels.get("fault"), rig.binding
    signal = None if channel is None else signal_at(messages, channel.signal)
    if channel is None or signal is None or not signal.choices:
        return
    known = tuple(signal.choices.values())
    stated = "no_fault" in b.model_fields_set
    if unknown := [name for name in b.no_fault if stated and name not in known]:
        yield f"{KEY}.no_fault", ", ".join(unknown), f"names of the value table of {channel.signal}: {', '.join(known)}"
    elif 0 in signal.choices and not set(b.no_fault) & set(known):
        yield (f"{KEY}.no_fault", "nothing", f"which of {', '.join(known)} say that nothing is wrong: "
               f'no_fault = ["{signal.choices[0]}"], if that is the one')  # fmt: skip
