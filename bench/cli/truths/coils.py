"""What coils of a winding truly carry of what is asked of them, by the drawn gains of their sensors.

A controller regulates d and q of its systems by readings: what is common to the coils of a star it leaves free, and there the
currents add up to nothing. A reading g_k i_k is so the wanted e_k plus what its star has in common, c: with
sum (e_k + c)/g_k = 0 over the star, c = -sum(e_k/g_k)/sum(1/g_k). A share is sum(i_k e_k)/sum(e_k^2) over d and q of all
systems, in which sum(e_j e_k) = sum over systems of size^2 cos(p_j - p_k), whatever the angle.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from bench.cli.truths.settings import Found

if TYPE_CHECKING:
    from bench.cli.virtual import Simulated


def shares(done: Simulated) -> Found:
    from procedures.coil_map.steps import size_of

    plan: Any = done.recording.plan
    can = done.recording.rig.capabilities.coil_map
    if can is None:
        return
    gain = {coil: done.drawn.values[f"{coil}.gain"] for coil in can.coils}
    star = {coil: one for one in can.stars for coil in one}

    def together(j: str, k: str) -> float:
        return sum(
            size_of(s, plan) ** 2 * math.cos(math.radians(s.coils[j] - s.coils[k]))
            for s in can.systems.values()
            if j in s.coils and k in s.coils
        )

    for k in can.coils:
        mine = star.get(k, (k,))
        common = -sum(together(j, k) / gain[j] for j in mine) / sum(1 / gain[j] for j in mine) if k in star else 0.0
        yield "share", k, (1 + common / together(k, k)) / gain[k]
