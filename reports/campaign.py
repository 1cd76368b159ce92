"""The summary of a campaign as HTML and PDF. Nothing here computes a result."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import typst
from jinja2 import Environment, PackageLoader, StrictUndefined, Template, TemplateError
from markupsafe import Markup

from bench.errors import BenchError
from reports.campaign_symbols import with_subscripts
from reports.campaign_view import SummaryView
from reports.pdf import _FIRST_WIDE, _seconds


def build(folder: Path, view: SummaryView, issued: str) -> None:
    """Write `summary.html` and `summary.pdf` into `folder`, replacing older ones; `issued` (ISO 8601) dates the PDF.

    Raises:
        BenchError: a page or a file cannot be made.
    """
    page, document = html(view).encode(), pdf(view, issued)
    for name, content in (("summary.html", page), ("summary.pdf", document)):
        _write(folder / name, content)


@cache
def _template() -> Template:
    environment = Environment(
        loader=PackageLoader("reports", "templates"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    environment.filters["subscripts"] = with_subscripts
    return environment.get_template("campaign.html.j2")


def html(view: SummaryView) -> str:
    """One self-contained page: no script, nothing fetched, every text escaped.

    Raises:
        BenchError: the template cannot be filled.
    """
    style = "".join((files("reports.templates") / name).read_text("utf-8") for name in ("report.css", "campaign.css"))
    drawings = {p.figure.number: Markup(p.figure.svg) for s in view.sections for p in s.pictures}
    try:
        return _template().render(r=view, style=Markup(style), drawings=drawings)
    except TemplateError as error:
        raise BenchError(f"the summary cannot be made: {error}") from error


def pdf(view: SummaryView, issued: str) -> bytes:
    """The A4 PDF. Equal views give equal bytes.

    Raises:
        BenchError: typst refuses the document.
    """
    content = dataclasses.asdict(view)
    sources: dict[str, bytes] = {"main.typ": (files("reports.templates") / "campaign.typ").read_bytes()}
    for section in content["sections"]:
        for picture in section["pictures"]:
            figure = picture["figure"]
            figure["file"] = f"figure-{figure['number']}.svg"
            sources[figure["file"]] = figure.pop("svg").encode()
    text = json.dumps(content, ensure_ascii=False)
    sources["view.json"] = text.encode()
    given: Any = sources  # typst takes files in memory by name; its stubs do not say so
    try:
        bundled_suffices = not any(ord(c) >= _FIRST_WIDE for c in text)
        made = typst.compile(given, ignore_system_fonts=bundled_suffices, timestamp=_seconds(issued))
    except (RuntimeError, ValueError) as error:
        said = str(getattr(error, "diagnostic", "") or error).strip()
        raise BenchError(f"the PDF summary cannot be made: {said}") from error
    return bytes(made)


def _write(path: Path, content: bytes) -> None:
    part = path.with_name(path.name + ".part")
    try:
        part.write_bytes(content)
        os.replace(part, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        raise BenchError(f"{path}: the summary cannot be written: {error.strerror or error}") from error
