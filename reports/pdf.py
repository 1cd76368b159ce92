"""The view model as an A4 PDF, set by typst from data: texts are values there, never markup."""

from __future__ import annotations

import dataclasses
import json
from datetime import datetime
from functools import cache
from importlib.resources import files
from typing import Any

import typst

from bench.errors import BenchError
from reports.view import ReportView

_FIRST_WIDE = 0x2E80  # from here on: scripts that the bundled fonts lack


@cache
def _template() -> bytes:
    return (files("reports.templates") / "report.typ").read_bytes()


def sources(view: ReportView) -> dict[str, bytes]:
    """What typst compiles, all in memory: the template, the view as JSON and the drawings."""
    content = dataclasses.asdict(view)
    for figure in content["figures"]:
        figure["file"] = f"figure-{figure['number']}.svg"
        del figure["svg"]
    made = {"main.typ": _template(), "view.json": json.dumps(content, ensure_ascii=False).encode()}
    return made | {f"figure-{figure.number}.svg": figure.svg.encode() for figure in view.figures}


def render(view: ReportView, issued: str | None = None) -> bytes:
    """The PDF. Equal views give equal bytes; `issued` (ISO 8601, the record's end) becomes the file's date.

    The fonts are those bundled with typst; system fonts are only asked for where a text needs a script they lack.

    Raises:
        BenchError: typst refuses the document.
    """
    files_by_name: Any = sources(view)  # typst takes files in memory by name; its stubs do not say so
    bundled_suffices = not any(ord(c) >= _FIRST_WIDE for c in files_by_name["view.json"].decode())
    try:
        made = typst.compile(files_by_name, ignore_system_fonts=bundled_suffices, timestamp=_seconds(issued))
    except (RuntimeError, ValueError) as error:
        said = str(getattr(error, "diagnostic", "") or error).strip()  # with the template's line
        raise BenchError(f"the PDF report cannot be made: {said}") from error
    return bytes(made)


def _seconds(issued: str | None) -> int:
    try:
        return int(datetime.fromisoformat(issued).timestamp()) if issued else 0
    except ValueError:
        return 0
