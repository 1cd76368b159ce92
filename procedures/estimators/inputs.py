"""From the rig file's certificates to estimates with influences, so that every use of a certificate shares one."""

from __future__ import annotations

from bench.toleranced import Toleranced
from bench.uncertainty import Estimate, Influence


def certified(identity: str, t: Toleranced, name: str = "") -> Estimate:
    """The certified value as an Estimate with one Type B influence known by `identity` (stable along the chain); `name` is what
    a budget calls it, else the last part of its identity."""
    influence = Influence(
        id=identity,
        name=name or identity.rpartition("/")[2].replace("_", " "),
        u=t.standard_uncertainty,
        unit=t.unit,
        kind="B",
        distribution=t.distribution,
        source=t.source,
    )
    return Estimate.of(t.value, influence)
