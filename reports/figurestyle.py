"""How figures look: colours, markers, sizes of type, numbers on axes."""

from __future__ import annotations

from typing import Any

from matplotlib.ticker import ScalarFormatter

# Okabe and Ito (2008), told apart with any colour vision; the yellow is left out: too pale on white.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
DASHES: tuple[Any, ...] = ("-", (0, (6, 1.4)), (0, (2, 1)), (0, (6, 1.4, 1.5, 1.4)))
INK, GRID = "#30363d", "#d9dde2"
STYLE: Any = {
    "font.family": ["DejaVu Sans"],
    "font.size": 7.0,
    "text.parse_math": False,
    "axes.unicode_minus": True,
    "axes.linewidth": 0.6,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-3, 5),
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.direction": "out",
    "lines.linewidth": 1.0,
    "lines.markersize": 3.2,
    "legend.fontsize": 6.5,
    "legend.frameon": False,
    "path.simplify": True,
    "svg.fonttype": "path",  # the same glyphs everywhere; nothing can be clipped by another font
    "svg.hashsalt": "levbench",
}


def tick_text() -> ScalarFormatter:
    """Plain numbers, with a power of ten where they are large or small; never an offset, which readers miss."""
    formatter = ScalarFormatter(useOffset=False, useMathText=False)
    formatter.set_powerlimits((-5, 6))
    return formatter
