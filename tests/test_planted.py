"""The files of planted defects: each is read, for a procedure that there is, with a plan that it has."""

from __future__ import annotations

import pytest

from bench.cli.compose import load_procedure
from bench.procedure.plans import assemble
from bench.rigfile import load_rig
from benchmarks import plants


@pytest.mark.parametrize("name", sorted(p.stem for p in plants.PLANTED.glob("*.toml")))
def test_a_file_of_plants_is_read(name: str) -> None:
    bed = plants.bed_of(name)
    rig = load_rig(bed.rig)
    settings = (rig.name, rig.plans.get(bed.procedure, {}))
    for plan in {bed.plan, *((*bed.plan, *plant.plan) for some in bed.plants for plant in some)}:
        assemble(load_procedure(bed.procedure).plan, settings, None, plan)
    for before, plan in bed.chain.items():
        assemble(load_procedure(before).plan, (rig.name, rig.plans.get(before, {})), None, plan)
    assert bed.plants
    assert all(some for some in bed.plants)
