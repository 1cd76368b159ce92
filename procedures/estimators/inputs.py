"""From the rig file's certificates to estimates with influences, so that every use of a certificate shares one."""

from __future__ import annotations

from bench.toleranced import Toleranced
from bench.uncertainty import Estimate, Influence


def certified(identity: str, t: Toleranced, name: str = "") -> Estimate:
    """The certified value as an Estimate with one Type B influence named by `identity` (stable along the chain)."""
    influence = Influence(
        id=identity,
        name=name or identity,
        u=t.standard_uncertainty,
        unit=t.unit,
        kind="B",
        distribution=t.distribution,
        source=t.source,
    )
    return Estimate.of(t.value, influence)
