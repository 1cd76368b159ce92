"""What was heard, at the end: counts, what is wrong and what to do, every message, every channel."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence

from bench.cli.listen.screen import Devices
from bench.cli.listen.words import number, rate, shown, unit_of
from bench.link.census import Tally, named
from bench.link.clockrate import described
from bench.link.listened import Listened
from bench.link.stillness import CODES
from bench.link.troubles import Trouble, remark

LABEL = 9
UNKNOWN = 20  # identifiers that the table has; the others are counted
COUNTS = (
    ("late", "late"), ("duplicates", "twice"), ("reordered", "out of order"), ("misplaced", "misplaced"),
    ("wrong_length", "of a wrong length"), ("reboots", "restarts"), ("sequence_leaps", "leaps of the sequence"),
    ("tick_leaps", "leaps of the tick"),
)  # fmt: skip


def summary(heard: Listened, found: Sequence[Trouble], devices: Devices, width: int) -> str:
    """Lines of text, each with its end."""
    lines = [f"{heard.rig.name}: listened {heard.seconds:.1f} s on {heard.ear.link}, {heard.ear.url}"]
    lines += _labelled("how", [heard.ear.manner], width)
    lines += _labelled("samples", [_samples(heard)], width)
    lines += _labelled("clock", [_clock(heard)], width)
    lines += _labelled("state", [_state(heard)], width)
    if heard.census.simulated:
        lines += _labelled("machine", ["none: the controller says that it is a simulated one"], width)
    for name, text in devices.items():
        lines += _labelled(name[:LABEL], [text], width)
    lines += _labelled("wrong", [t.text for t in found] or ["nothing"], width)
    lines += ["", *_messages(heard), "", *_channels(heard)]
    return "\n".join(lines) + "\n"


def _samples(heard: Listened) -> str:
    c = heard.decoder.counters
    whole = sum(t.lengths[m.length] for m in heard.census.telemetry[:1] if (t := heard.census.of(m)) is not None)
    rest = [f"{n} {words}" for field, words in COUNTS if (n := getattr(c, field))]
    told = [
        f"{whole} at {rate(heard.mean_hz)}, by the DBC {rate(heard.due_hz)}",
        f"lost {c.lost} in {c.gaps} gaps",
        *rest,
    ]
    return "; ".join(told)


def _clock(heard: Listened) -> str:
    if (drift := heard.drift_ppm) is not None:
        return f"{described(drift[0])} (U = {drift[1]:.1f} ppm)"
    tick_s, stated = heard.tick_s, heard.rig.devices["controller"].tick_s
    if tick_s is None:
        return "the tick cannot be compared with the host's clock: it does not count, or too few samples came"
    return f"a tick takes {tick_s:.3g} s by this host's clock, {stated:.3g} s by the rig file; its drift takes longer to tell"


def _state(heard: Listened) -> str:
    state, fault = heard.readings.code("state"), heard.readings.code("fault")
    if not state and not fault:
        return "never came"
    mode = heard.rig.binding.mode(state)
    return f"{state or '-'}{f' ({mode})' if mode and mode != state else ''}, fault {fault or '-'}"


def _messages(heard: Listened) -> list[str]:
    """Each that came, then those that the DBC does not know, then those that did not come."""
    census = heard.census
    lines = [f"  {'message':24} {'identifier':>10} {'bytes':>7} {'count':>9} {'rate':>9} {'DBC':>9}"]
    of_hosts = {m.identifier for m, _ in census.of_hosts}
    for identifier, tally in sorted(census.by_id.items()):
        if (message := census.known.get(identifier)) is not None:
            due = rate(1 / message.period_s) if message.period_s else "asked for"
            name = f"{message.name} (a host's)" if identifier in of_hosts else message.name
            lines.append(_row(name, tally, due))
    unknown = census.unknown
    lines += [_row("unknown", t, "") for t in unknown[:UNKNOWN]]
    if len(unknown) > UNKNOWN:
        lines.append(f"  and {len(unknown) - UNKNOWN} more unknown identifiers")
    for words, absent in (("never came", census.absent), ("did not come, as nobody asked", census.silent)):
        if absent:
            names = ", ".join(m.name for m in absent)
            lines += textwrap.wrap(f"{words}: {names}", 78, initial_indent="  ", subsequent_indent="    ")
    return lines


def _row(name: str, tally: Tally, due: str) -> str:
    lengths = "/".join(str(n) for n in sorted(tally.lengths))
    return (f"  {name:24} {named(tally.identifier):>10} {lengths:>7} {tally.count:>9} {rate(tally.mean_hz):>9} "
            f"{due:>9}").rstrip()  # fmt: skip


def _channels(heard: Listened) -> list[str]:
    lines = [f"  {'channel':20} {'now':>12} {'lowest':>12} {'highest':>12} unit"]
    for name, reading in heard.readings.by_name.items():
        value, symbol = shown(name, reading, heard)
        if name in CODES or not reading.count:
            lines.append(f"  {name:20} {value:>12} {'':33}{remark(reading) if name not in CODES else ''}".rstrip())
            continue
        _, one = unit_of(reading)
        low, high = (number(x, reading, one) for x in (reading.low, reading.high))
        lines.append(f"  {name:20} {value:>12} {low:>12} {high:>12} {symbol:6}{remark(reading)}".rstrip())
    return lines


def _labelled(label: str, texts: Sequence[str], width: int) -> Iterator[str]:
    """Texts beside a label, broken between words."""
    first = label
    for text in texts:
        yield from textwrap.wrap(text, width, initial_indent=f"  {first:{LABEL}} ", subsequent_indent=" " * (LABEL + 3),
                                 break_on_hyphens=False)  # fmt: skip
        first = ""
