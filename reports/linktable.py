"""The controller's link as a table for people: what came, what went wrong, how late, how the clocks drift."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from reports import tables, text
from reports.view import Table

Content = Mapping[str, Any]
COUNTS = {
    "gaps": "Gaps in telemetry", "lost": "Samples lost", "late": "Samples past their gap", "duplicates": "Samples repeated",
    "reordered": "Samples out of order", "wrong_length": "Frames of wrong length", "unknown": "Frames unknown to the DBC",
    "reboots": "Restarts of the controller", "received": "Frames received", "sent": "Frames sent, heartbeats included",
    "crc_errors": "Packets with a wrong CRC", "malformed": "Malformed packets or lines", "packets_lost": "Packets lost",
    "error_frames": "Error frames", "refused": "Frames refused by the interface", "overflows": "Frames dropped, buffer full",
    "misplaced": "Messages too late to tell their sample", "adapter_overruns": "Times that the adapter lost frames",
    "sequence_leaps": "Leaps of the sequence", "tick_leaps": "Leaps of the tick",
    "bus_off": "Times bus-off", "reconnects": "Times reconnected", "heartbeats": "Heartbeats sent",
    "longest_heartbeat_gap_ns": "Longest time between heartbeats",
}  # fmt: skip
ALWAYS = ("received", "sent", "heartbeats", "longest_heartbeat_gap_ns")
OWN = ("frames", "gaps", "errors", "counts", "drift_ppm", "drift_expanded_ppm", "latest_ms", "round_trip_ms")


def link_table(link: Content) -> Table:
    """Two columns: what happened at all. `clean` names the rest."""
    rows = [*_counted(link), *_measured(link)]
    rows += [(tables.inline(k), tables.inline(v)) for k, v in link.items() if k not in OWN]
    return Table("Controller's link", ("", ""), tuple(rows), (1,))


def clean(link: Content) -> str:
    """What was watched for and did not happen, as a sentence; "" where nothing is known."""
    names = [COUNTS.get(n, tables.inline(n)) for n, v in _counts(link).items() if n not in ALWAYS and not v]
    return f"Watched for and not seen: {', '.join(n[:1].lower() + n[1:] for n in names)}." if names else ""


def _counts(link: Content) -> dict[str, Any]:
    counts = link.get("counts")
    found: dict[str, Any] = {"gaps": link.get("gaps"), **(dict(counts) if isinstance(counts, Mapping) else {})}
    return {k: v for k, v in found.items() if v is not None}


def _counted(link: Content) -> Iterator[tuple[str, str]]:
    found = _counts(link)
    if link.get("frames") is not None:
        yield "Frames recorded", tables.inline(link["frames"])
    for name in (*ALWAYS, *(n for n in found if n not in ALWAYS)):
        if name in found and (found[name] or name in ALWAYS):
            value = found[name]
            if name.endswith("_ns") and isinstance(value, int | float):
                yield COUNTS.get(name, name), text.with_unit(text.plain(round(value * 1e-6, 1)), "ms")
            else:
                yield COUNTS.get(name, tables.inline(name)), tables.inline(value)


def _measured(link: Content) -> Iterator[tuple[str, str]]:
    drift, expanded = link.get("drift_ppm"), link.get("drift_expanded_ppm")
    if isinstance(drift, int | float):
        value = text.result(float(drift), float(expanded) if isinstance(expanded, int | float) else None, "")
        yield "Host clock against the controller's, parts per million", value
    for key, words in (("latest_ms", "Greatest lateness of a sample"), ("round_trip_ms", "Least time to an answer")):
        if isinstance(link.get(key), int | float):
            yield words, text.with_unit(text.plain(round(float(link[key]), 2)), "ms")
