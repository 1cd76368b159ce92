"""What is wrong with what was heard, in words, with the next step. The worst first: what makes the rest meaningless."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from bench.link.census import Tally, named
from bench.link.clockrate import described
from bench.link.listened import APART, Listened
from bench.link.readings import Reading

PATIENCE_S, RATE_S = 1.0, 3.0  # before silence is told, and a rate
DRIFT_PPM = 200.0  # of two crystals less; a run asks for no more
SOME = 6  # of a list, on a line
FEW = 3  # bytes: a delimiter, and what opening a port may stir up


@dataclass(frozen=True)
class Trouble:
    """One thing: `key` stays while its counts rise; `text` ends with what to do."""

    key: str
    text: str


def troubles(heard: Listened) -> list[Trouble]:
    """All of them, now."""
    if not heard.frames or not heard.census.by_id:
        return [_nothing(heard)] if heard.seconds >= PATIENCE_S else []
    of_telemetry = [m for m in heard.census.telemetry if heard.census.of(m) is not None]
    if not of_telemetry:
        return [_another_dbc(heard), *_transport(heard)] if heard.seconds >= PATIENCE_S else []
    return [*_stopped(heard), *_shapes(heard), *_counters(heard), *_rates(heard), *_losses(heard), *_transport(heard),
            *_codes(heard), *_channels(heard), *_strangers(heard)]  # fmt: skip


def _nothing(heard: Listened) -> Trouble:
    """Silence, bytes that are no messages, or errors alone."""
    s, ear, link = heard.stats, heard.ear, heard.rig.link
    if heard.census.errors or s.error_frames:
        return Trouble("errors-only", f"{heard.census.errors or s.error_frames} error frames and no other: the bit rate is "
                       f"not the bus's{_rates_told(heard)}, or wiring and termination are wrong. Next: compare bitrate and "
                       f"data_bitrate of [links.{ear.link}] with the controller's")  # fmt: skip
    if ear.complaint:
        return Trouble("bus-errors", f"{ear.complaint}, and nothing comes: is that the bus's rate? Is the bus connected, and "
                       f"terminated at both ends? Next: correct bitrate of [links.{ear.link}], then wiring")  # fmt: skip
    if s.octets > FEW:
        wrong = f"{s.malformed} pieces that are none, {s.crc_errors} with a wrong CRC"
        return Trouble("bytes-unreadable", f"{s.octets} bytes came, and no message can be made of them ({wrong}). Next: "
                       "compare the kind of the link (serial: is packets, slcan: lines) and its baud rate with the "
                       "controller's; is it the right port?")  # fmt: skip
    text = f"nothing comes over {ear.url}. Next: is the controller switched on, and does it send before a host speaks?"
    if link.bitrate:
        text += f" Is its bit rate{_rates_told(heard)}, is the bus wired and terminated?"
    if "acknowledges nothing" in ear.manner or "as far as can be told" in ear.manner:
        text += (" On a bus of the controller and this adapter alone nobody acknowledges, and no frame gets through: then "
                 "listen with --acknowledge")  # fmt: skip
    return Trouble("nothing", text)


def _rates_told(heard: Listened) -> str:
    link = heard.rig.link
    rates = [f"{r * 1e-3:g}" for r in (link.bitrate, link.data_bitrate) if r]
    return f" ({' and '.join(rates)} kbit/s)" if rates else ""


def _another_dbc(heard: Listened) -> Trouble:
    due = ", ".join(f"{named(m.identifier)} {m.name}" for m in heard.census.telemetry)
    came = _some(named(t.identifier) for t in heard.census.by_id.values())
    return Trouble("another-dbc", f"{heard.frames} frames came, none of telemetry: the DBC has {due}; on the bus are {came}. "
                   f"Next: is {heard.rig.link.dbc} of this controller, are its identifiers 11 or 29 bits long, is this the "
                   "right bus? telemetry under [devices.controller.binding] names its messages")  # fmt: skip


def _stopped(heard: Listened) -> Iterator[Trouble]:
    if heard.silent_s >= PATIENCE_S:
        yield Trouble("stopped", f"telemetry has not come for {heard.silent_s:.0f} s. Next: look at the controller's supply, "
                      "the plug, the bus")  # fmt: skip


def _shapes(heard: Listened) -> Iterator[Trouble]:
    """Lengths, and telemetry of which a part is missing."""
    for message, wrong in heard.census.misshapen:
        lengths = " and ".join(f"{n}" for n in wrong)
        yield Trouble(f"length-{message.name}", f"{message.name} ({named(message.identifier)}): {sum(wrong.values())} frames "
                      f"of {lengths} bytes, the DBC says {message.length}; they are not read. Next: compare the firmware's "
                      f"message map with {heard.rig.link.dbc}")  # fmt: skip
    if heard.seconds < PATIENCE_S:
        return
    if missing := [m for m in heard.census.absent if m in heard.census.telemetry]:
        names = ", ".join(f"{m.name} ({named(m.identifier)})" for m in missing)
        yield Trouble("part-absent", f"telemetry never had {names}: no sample is whole. Next: does the controller send "
                      "it, with this identifier? Else take it out of binding.telemetry")  # fmt: skip
    if missing := [m for m in heard.census.absent if m not in heard.census.telemetry]:
        names = ", ".join(f"{m.name} ({named(m.identifier)})" for m in missing)
        yield Trouble("absent", f"never came, though the DBC states a period: {names}")


def _counters(heard: Listened) -> Iterator[Trouble]:
    """Counters that stand, or that count in the other byte order."""
    b, steps, swapped = heard.rig.binding, heard.counting.steps, heard.counting.swapped_steps
    first = heard.census.telemetry[0].name
    for signal, plain in ((b.sequence, "sequence"), (b.tick, "tick")):
        if signal not in steps:
            continue
        step, other = steps[signal], swapped.get(signal)
        if step == 0 and heard.seconds >= PATIENCE_S:
            yield Trouble(f"stands-{plain}", f"{first}.{signal} stands while frames come: a {plain} must count. Next: does "
                          f"the firmware fill it? Does binding.{plain} name the right signal?")  # fmt: skip
        elif other is not None and _counts(other) and not _counts(step):
            yield Trouble(f"order-{plain}", f"{first}.{signal} goes on by {step} from frame to frame, and by {other} with its "
                          "bytes the other way round: the DBC has the wrong byte order (@1 little, @0 big)")  # fmt: skip
        elif plain == "sequence" and step not in (0, 1):
            yield Trouble("sequence-steps", f"{first}.{signal} goes on by {step} from frame to frame; a sequence goes on by 1. "
                          "Next: does it count ticks, or are frames left out on the way?")  # fmt: skip


def _counts(step: int) -> bool:
    return 1 <= step <= 255


def _sound(heard: Listened) -> bool:
    """Whether the counters count as they should."""
    return heard.counting.steps.get(heard.rig.binding.sequence) == 1


def _rates(heard: Listened) -> Iterator[Trouble]:
    """The telemetry's rate and the tick against the host's clock."""
    rate, due, tick_s = heard.mean_hz, heard.due_hz, heard.rig.devices["controller"].tick_s
    if heard.seconds < RATE_S or not _sound(heard):
        return
    if rate and abs(rate / due - 1) > APART:
        yield Trouble("rate", f"telemetry comes {rate:.4g} times a second without a gap, the DBC says {due:.4g}. Next: correct "
                      f"GenMsgCycleTime of {heard.census.telemetry[0].name}, or the firmware")  # fmt: skip
    if (seen := heard.tick_s) is not None and abs(seen / tick_s - 1) > APART:
        yield Trouble("tick", f"a tick takes {seen:.3g} s by this host's clock, the rig file says {tick_s:.3g} s. Next: tick_s "
                      "under [devices.controller], or does another signal hold the tick?")  # fmt: skip
    elif (drift := heard.drift_ppm) is not None and abs(drift[0]) - drift[1] > DRIFT_PPM:
        yield Trouble("drift", f"{described(drift[0])} (U = {drift[1]:.0f} ppm). Next: tick_s, the controller's crystal, or, "
                      "of a served rig, whether its computer keeps up")  # fmt: skip


def _losses(heard: Listened) -> Iterator[Trouble]:
    """By the telemetry's own counters, where these count."""
    c = heard.decoder.counters
    if not heard.consistent:
        return
    told = (
        (c.lost, "lost", f"{c.lost} samples are missing in {c.gaps} gaps. Next: bus load (`bench check`), the adapter, this "
         "computer"),
        (c.sequence_leaps, "leaps", f"the sequence leapt {c.sequence_leaps} times while the tick went on"),
        (c.tick_leaps, "tick-leaps", f"the tick leapt {c.tick_leaps} times while the sequence went on"),
        (c.duplicates, "twice", f"{c.duplicates} samples came twice"),
        (c.reordered, "order", f"{c.reordered} samples came out of order"),
        (c.misplaced, "misplaced", f"{c.misplaced} messages came too late or too early to tell their sample. Next: does "
         f"{heard.rig.binding.counter} have the lowest bits of the sequence?"),
        (c.reboots, "restarts", f"the controller restarted {c.reboots} times"),
    )  # fmt: skip
    yield from (Trouble(key, text) for count, key, text in told if count)


def _transport(heard: Listened) -> Iterator[Trouble]:
    s = heard.stats
    told = (
        (s.error_frames, "error-frames", f"{s.error_frames} error frames. Next: termination, wiring, sample point"),
        (s.crc_errors, "crc", f"{s.crc_errors} packets failed their CRC"),
        (s.malformed, "malformed", f"{s.malformed} pieces of the byte stream are no message. Next: baud rate, cable, another "
         "program on this port"),
        (s.packets_lost, "packets", f"{s.packets_lost} packets are missing by their own numbers"),
        (s.adapter_overruns, "overrun", f"the adapter told {s.adapter_overruns} times of frames that it lost"),
        (s.overflows, "overflow", f"{s.overflows} frames were dropped here: this computer does not keep up"),
    )  # fmt: skip
    yield from (Trouble(key, text) for count, key, text in told if count)


def _codes(heard: Listened) -> Iterator[Trouble]:
    """States and faults that the DBC or the binding does not name."""
    for channel in ("state", "fault"):
        if "no name" in (told := heard.readings.code(channel)):
            yield Trouble(
                f"code-{channel}", f"{channel} is {told}: next, its value table (VAL_), or is it the right signal?"
            )
    state = heard.readings.code("state")
    if state and "no name" not in state and heard.rig.binding.mode(state) is None:
        yield Trouble("meaning", f"state {state} has no meaning. Next: binding.states.{state} in the rig file")


def _channels(heard: Listened) -> Iterator[Trouble]:
    """Channels that stand at an end, leave their range, or have no number. Readings that stand are not wrong by themselves."""
    readings = heard.readings.by_name
    kinds = (
        ("numberless", "no-number", "hold no number (NaN or infinite)", "type and place of the signal in the DBC"),
        ("outside", "outside", "read beyond the range that the DBC states for the signal", "place, length, sign and byte order "
         "of the signal, or its [min|max]"),
        ("ends", "ends", "stood at an end of what their signals hold", "is the sensor connected? Is the scale right?"),
        ("beyond", "beyond", "left the envelope", "a run would be stopped: scale, sign, or [envelope]"),
    )  # fmt: skip
    told: set[str] = set()
    for field, key, text, step in kinds:
        names = [n for n, r in readings.items() if getattr(r, field) and n not in told]
        told.update(names)
        if names:
            ages = field == "ends" and any(heard.rig.channels[n].unit == "s" for n in names)
            calm = " (an age of the heartbeat does so while no host drives)" if ages else ""
            yield Trouble(key, f"{_some(names)} {text}{calm}. Next: {step}")
    still = [n for n, r in readings.items() if heard.rig.noisy(n) and r.count > 1 and not r.moves]
    if still and heard.seconds >= PATIENCE_S and heard.readings.held:
        yield Trouble("stuck", f"{_some(still)} read the same all the time while the rotor is held; the rig file says that "
                      "they have noise. Next: the sensor, its supply, its place in the DBC")  # fmt: skip


def _strangers(heard: Listened) -> Iterator[Trouble]:
    unknown = heard.census.unknown
    if unknown:
        one = "identifier that the DBC does not know" if len(unknown) == 1 else "identifiers that the DBC does not know"
        yield Trouble("unknown", f"{len(unknown)} {one}: {_some(stranger(t, heard.now_ns) for t in unknown)}")


def stranger(tally: Tally, now_ns: int) -> str:
    """An identifier with its count, rate and lengths."""
    lengths = "/".join(str(n) for n in sorted(tally.lengths))
    return f"{named(tally.identifier)} ({tally.count}, {tally.rate_hz(now_ns):.3g}/s, {lengths} bytes)"


def remark(reading: Reading) -> str:
    """What stands beside a channel: one word, the worst."""
    if reading.numberless:
        return "no number"
    if not reading.count:
        return "never came"
    if reading.outside:
        return "out of range"
    if reading.ends:
        return "at its end"
    if reading.beyond:
        return "beyond"
    return "" if reading.moves or reading.count < 2 or not math.isfinite(reading.value) else "stands"


def _some(names: Iterable[str]) -> str:
    found = list(names)
    more = f" and {len(found) - SOME} more" if len(found) > SOME else ""
    return ", ".join(found[:SOME]) + more
