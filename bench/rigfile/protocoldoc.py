"""The generated part of docs/reference/protocol.md: message tables, codes and parameters, from a rig file and its DBC.

`python -m bench.rigfile.protocoldoc [RIG]` prints it, each section between its markers; with `--into PAGE` it replaces the
sections of a page instead. `--own` are the sections of a page of one rig: its telemetry and its parameters; `--captures`
those of the page of captures.
"""

from __future__ import annotations

import argparse
import math
import re
import sys
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path

from bench.errors import ConfigError
from bench.rigfile import capture
from bench.rigfile.load import load_rig
from bench.rigfile.messages import Message, MessageMap, Signal
from bench.rigfile.model import RigFile

RIG = "rigs/tsbs12.toml"
CODES = (("state", "CommandReply"), ("fault", "Telemetry"), ("code", "Command"), ("status", "CommandReply"))
HEADINGS = {"code": "command"}
CAPTURE_CODES = (("trigger", "CaptureArm"), ("code", "CaptureAsk"), ("form", "CaptureRead"), ("status", "CaptureStatus"),
                 ("state", "CaptureStatus"))  # fmt: skip


def sections(rig: RigFile) -> dict[str, str]:
    """The generated sections by name, in Markdown, without their markers."""
    ordered = sorted(rig.messages.messages.values(), key=lambda m: m.identifier)
    return {
        "messages": _overview(ordered),
        "layouts": "\n\n".join(_layout(m) for m in ordered),
        "codes": _codes(rig.messages),
        "parameters": _parameters(rig),
    }


def own_sections(rig: RigFile) -> dict[str, str]:
    """The generated sections of a page of one rig."""
    return {
        "telemetry": "\n\n".join(_layout(rig.messages[name]) for name in rig.binding.telemetry),
        "parameters": _parameters(rig),
    }


def capture_sections(rig: RigFile) -> dict[str, str]:
    """The generated sections of the page of captures, from a rig that has them."""
    assert rig.capture is not None
    messages = [rig.messages[name] for name in capture.MESSAGES]
    known = sorted(rig.capture.channels.items(), key=lambda item: item[1].index)
    rows = [(str(c.index), f"`{name}`", c.type, f"{c.scale:g}", c.unit, c.about) for name, c in known]
    return {
        "messages": _overview(messages),
        "layouts": "\n\n".join(_layout(m) for m in messages),
        "codes": _code_table(rig.messages, CAPTURE_CODES),
        "channels": _table(("index", "name", "type", "scale", "unit", "about"), rows),
    }


def marked(name: str, text: str) -> str:
    """A section between its markers."""
    return f"<!-- generated: {name} (python -m bench.rigfile.protocoldoc) -->\n\n{text}\n\n<!-- end of {name} -->"


def replaced(page: str, generated: Mapping[str, str]) -> str:
    """A page with every generated section in place of what stands between its markers.

    Raises:
        ConfigError: the page has no markers for a section, or has them twice.
    """
    for name, text in generated.items():
        pattern = rf"<!-- generated: {name} [^\n]*-->.*?<!-- end of {name} -->"
        page, count = re.subn(pattern, marked(name, text).replace("\\", r"\\"), page, flags=re.DOTALL)
        if count != 1:
            raise ConfigError(f"generated section {name}: found {count} pairs of markers in the page; expected one")
    return page


def _overview(messages: Sequence[Message]) -> str:
    rows = [
        (f"0x{m.identifier:03X}", m.name, str(m.length), m.sender.lower(), _when(m.period_s), m.comment)
        for m in messages
    ]
    return _table(("identifier", "message", "bytes", "sender", "when", "meaning"), rows)


def _layout(m: Message) -> str:
    title = f"#### 0x{m.identifier:03X} {m.name}: {m.length} bytes, from the {m.sender.lower()}, {_when(m.period_s)}"
    ordered = sorted(m.signals, key=lambda s: s.start)
    parts = [list(g) for _, g in groupby(ordered, key=_part_of_name)]
    rows = [_row(part) for part in parts]
    return f"{title}\n\n{_table(('bytes', 'signal', 'type', 'scale', 'unit', 'meaning'), rows)}"


def _part_of_name(s: Signal) -> str:
    """Signals of an odd width with numbered names are parts of one text; every other signal stands alone."""
    return s.name.rstrip("0123456789") if s.length not in (8, 16, 32, 64) else s.name


def _row(part: Sequence[Signal]) -> tuple[str, ...]:
    s, last = part[0], part[-1]
    low, high = s.start // 8, (last.start + last.length) // 8 - 1
    where = f"{low}–{high}" if high > low else str(low)
    if len(part) > 1:
        size = last.start + last.length - s.start
        text = "who and where it is: UTF-8, zero padded"
        return where, f"`{s.name}` to `{last.name}`", f"{size // 8} bytes", "–", "–", text
    if s.start % 8 or s.length % 8 or not s.little_endian:
        raise ConfigError(f"signal {s.name} does not fill whole little-endian bytes; this page could not describe it")
    kind = "f" if s.is_float else "i" if s.signed else "u"
    return where, f"`{s.name}`", f"{kind}{s.length}", _scale(s), s.unit or "–", s.comment


def _scale(s: Signal) -> str:
    if s.choices:
        return "code"
    plus = f" + {s.offset:g}" if s.offset else ""
    if math.isclose(s.scale, 2 * math.pi / 65536, rel_tol=1e-12):
        return "2π/65536" + plus
    return f"{s.scale:g}{plus}"


def _codes(messages: MessageMap) -> str:
    return _code_table(messages, CODES)


def _code_table(messages: MessageMap, codes: Sequence[tuple[str, str]]) -> str:
    tables = [dict(messages[message].signal(signal).choices) for signal, message in codes]
    rows = [(str(n), *(table.get(n, "") for table in tables)) for n in range(max(max(table) for table in tables) + 1)]
    return _table(("code", *(HEADINGS.get(signal, signal) for signal, _ in codes)), rows)


def _parameters(rig: RigFile) -> str:
    known = [(p.index, name, p) for name, p in rig.parameters.items() if p.index is not None]
    told = any(p.about for _, _, p in known)
    rows = [
        (str(index), f"`{name}`", p.unit, f"{p.default:g}", f"{p.low:g} to {p.high:g}", p.when, *([p.about] * told))
        for index, name, p in sorted(known, key=lambda row: row[0])
    ]
    return _table(("index", "name", "unit", "default", "range", "when", *(["about"] * told)), rows)


def _when(period_s: float) -> str:
    return f"every {period_s * 1e3:g} ms" if period_s else "on demand"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the sections, or put them into a page. Returns the exit status: 0, or 2 for a rig or page that will not do."""
    parser = argparse.ArgumentParser(prog="python -m bench.rigfile.protocoldoc", description=__doc__)
    parser.add_argument("rig", nargs="?", default=RIG, help="rig file (default: %(default)s)")
    parser.add_argument("--into", type=Path, metavar="PAGE", help="replace the generated sections of a page")
    parser.add_argument("--own", action="store_true", help="telemetry and parameters alone")
    parser.add_argument("--captures", action="store_true", help="what belongs to captures alone")
    given = parser.parse_args(arguments)
    try:
        chosen = capture_sections if given.captures else own_sections if given.own else sections
        generated = chosen(load_rig(given.rig))
        if given.into is None:
            sys.stdout.write("\n\n".join(marked(name, text) for name, text in generated.items()) + "\n")
        else:
            page = given.into.read_text(encoding="utf-8")
            given.into.write_text(replaced(page, generated), encoding="utf-8")
    except (ConfigError, OSError) as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
