"""Reports: a record and its recording as HTML and PDF. Nothing here can reach hardware or change a verdict."""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.errors import BenchError

if TYPE_CHECKING:
    from bench.figures import Shown
    from bench.procedure import Quantity
    from bench.recording import Recording

__all__ = ["ReportPaths", "build"]


@dataclasses.dataclass(frozen=True)
class ReportPaths:
    """Where a report was written."""

    html: Path
    pdf: Path


def build(
    run_dir: Path,
    recording: Recording[Any] | None,
    record: Mapping[str, Any],
    figures: Iterable[Shown] = (),
    *,
    title: str,
    method: str = "",
    measures: Sequence[Quantity] = (),
    reached: Sequence[str] = (),
    assumes: Sequence[str] = (),
    conditions: Mapping[str, str] | None = None,
) -> ReportPaths:
    """Writes `report.html` and `report.pdf` into `run_dir`, replacing older ones; touches nothing else.

    `record` is the content of record.json; `recording` is None where there is none to read; `title`, `method`, `measures`,
    `reached` and `assumes` are the procedure's; `conditions` are measured ones as label and text with unit.

    Raises:
        BenchError: a figure, a page or a file cannot be made. Record and verdict are not affected.
    """
    from reports import compose, front, html, pdf  # heavy: only who builds a report pays

    around = compose.Surroundings(
        title=title,
        method=method,
        reached=reached,
        assumes=assumes,
        definitions={q.name: q.about for q in measures},
        titles={q.name: q.title for q in measures if q.title},
        rig={} if recording is None else recording.rig.model_dump(mode="json", exclude_none=True),
        integrity=None if recording is None else recording.integrity,
        conditions=conditions or {},
        truncated=recording is not None and recording.truncated,
        readable=recording is not None,
    )
    try:
        shown = list(front.drawn(figures))
        view = compose.view_of(record, around, shown)
        page, document = html.render(view), pdf.render(view, record.get("ended"))
    except BenchError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise BenchError(f"the report of {run_dir} cannot be made from its record: {error!r}") from error
    paths = ReportPaths(run_dir / "report.html", run_dir / "report.pdf")
    _write(paths.html, page.encode())
    _write(paths.pdf, document)
    return paths


def _write(path: Path, content: bytes) -> None:
    """Whole or not at all: a reader never finds half a report."""
    part = path.with_name(path.name + ".part")
    try:
        part.write_bytes(content)
        os.replace(part, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        raise BenchError(f"{path}: the report cannot be written: {error.strerror or error}") from error
