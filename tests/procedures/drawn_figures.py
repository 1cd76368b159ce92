"""The figures of a run, drawn as its report draws them."""

from __future__ import annotations

from bench.cli.virtual import Simulated
from bench.figures import Figure
from reports.figures import draw


def figures_drawn(done: Simulated) -> list[str]:
    """The keys of what the report shows, each figure drawn."""
    shown = list(done.procedure.drawn(done.recording))
    assert all(draw(figure) for figure in shown if isinstance(figure, Figure))
    return [one.key for one in shown]
