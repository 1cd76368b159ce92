"""The view model as one self-contained HTML page."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined, Template, TemplateError
from markupsafe import Markup, escape

from bench.errors import BenchError
from reports import text
from reports.view import ReportView


@cache
def _template() -> Template:
    environment = Environment(
        loader=PackageLoader("reports", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["prose"] = _prose
    environment.filters["css"] = _css_string
    return environment.get_template("report.html.j2")


def _prose(said: str) -> Markup:
    """A text with its symbols set as such, everything escaped."""
    return Markup("").join(
        Markup("<i>{}</i><sub>{}</sub>").format(part, below) if below else escape(part)
        for part, below in text.symbols(said)
    )


def _css_string(said: str) -> Markup:
    """A text as a string of a style sheet: every sign but letters, digits and blanks by its number."""
    plain = (c if c.isascii() and (c.isalnum() or c == " ") else f"\\{ord(c):06x}" for c in said)
    return Markup('"{}"').format(Markup("".join(plain)))


@cache
def _style() -> Markup:
    return Markup((files("reports.templates") / "report.css").read_text("utf-8"))


def render(view: ReportView) -> str:
    """The page: no script, nothing fetched, every text escaped. Equal views give equal pages.

    Raises:
        BenchError: the template cannot be filled.
    """
    drawings = {figure.key: Markup(figure.svg) for figure in view.figures}  # ours, from data; texts in it are glyphs
    try:
        return _template().render(r=view, style=_style(), drawings=drawings)
    except TemplateError as error:
        raise BenchError(f"the HTML report cannot be made: {error}") from error
