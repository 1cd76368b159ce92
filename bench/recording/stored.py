"""What stands in a recording as JSON, taken as what it must be: a file may come from anybody."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, Final

from bench.errors import RecordingError
from bench.recording.layout import KINDS
from bench.samples import ChannelInfo, StreamLayout

LONGEST_PERIOD_NS: Final = 10**13
LAST_NS: Final = (1 << 63) - 1
MOST_CHANNELS: Final = 2000


def parsed(text: str | bytes, where: str) -> Any:
    """The value of a JSON text.

    Raises:
        RecordingError: it is none; `where` stands in the message.
    """
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"{where} is not JSON: {error}") from error


def event_of(data: bytes, where: str) -> dict[str, Any]:
    """An event: its `kind`, its `t_ns`, and for steps and captures what they have.

    Raises:
        RecordingError: something of that is missing or of another type.
    """
    event = parsed(data, where)
    sound = isinstance(event, dict) and isinstance(event.get("kind"), str) and _is_time(event.get("t_ns"))
    if sound and event["kind"] in ("step-begin", "step-end", "step-corrected"):
        sound = type(event.get("step")) is int
    if sound and event["kind"] in ("step-begin", "step-corrected"):
        sound = isinstance(event.get("labels"), dict)
    if sound and event["kind"] == "step-begin":
        sound = isinstance(event.get("name"), str)
    if sound and event["kind"] == "capture":
        sound = _is_capture(event)
    if not sound:
        raise RecordingError(f"{where}: found {data[:60]!r}; expected kind, t_ns and what its kind has beside them")
    return dict(event)


def _is_capture(event: Mapping[str, Any]) -> bool:
    numbers = all(_is_time(event.get(name)) for name in ("first_tick", "start_ns", "trigger", "samples"))
    rate = event.get("rate_hz")
    timed = isinstance(rate, int | float) and 0 < rate < math.inf
    tables = all(isinstance(event.get(name), dict) for name in ("labels", "waited_for"))
    return numbers and timed and tables and isinstance(event.get("stream"), str)


def _is_time(value: object) -> bool:
    return type(value) is int and 0 <= value <= LAST_NS


def stream_of(name: str, text: str, where: str) -> StreamLayout:
    """A stream from the metadata of its channel.

    Raises:
        RecordingError: it has no period or no channels that a stream could have.
    """
    described = parsed(text, where)
    try:
        period_ns, listed = described["period_ns"], described["channels"]
        channels = tuple(ChannelInfo(*map(str, c)) for c in listed)
    except (TypeError, KeyError) as error:
        raise RecordingError(f"{where}: its layout cannot be read: {error!r}") from error
    known = all(c.dtype in KINDS for c in channels) and len({c.name for c in channels}) == len(channels)
    if not (type(period_ns) is int and 0 < period_ns < LONGEST_PERIOD_NS and known and len(channels) <= MOST_CHANNELS):
        raise RecordingError(f"{where}: its layout has a period or channels that no stream has")
    return StreamLayout(name, period_ns, channels)


def integrity_of(found: Mapping[str, str], where: str) -> dict[str, Any]:
    """The counts at the end of a recording.

    Raises:
        RecordingError: they are no counts.
    """
    out = {name: parsed(text, where) for name, text in found.items()}
    for name in ("frames", "samples", "lost", "blocks"):
        counts = out.get(name, {})
        if not (isinstance(counts, dict) and all(type(n) is int for n in counts.values())):
            raise RecordingError(f"{where} cannot be read: {name}: found no counts")
    return out
