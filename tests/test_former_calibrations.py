"""Calibrations that were adopted before rig files named places: taken by a run of today, with the same numbers."""

from __future__ import annotations

import shutil
from datetime import datetime
from pathlib import Path

import pytest
from recordings import HEADER, record

from bench.calibration import Calibration
from bench.calibration.file import attachment, read
from bench.calibration.lookup import Lookup
from bench.calibration.store import Store
from bench.cli.loading import load_procedure
from bench.recording import Recording
from bench.recording.recorder import RunHeader
from bench.rigfile import RigFile, load_rig

FORMER = Path(__file__).resolve().parent / "former"
"""As `bench adopt` wrote them at commit 937c3b9, of virtual rigs of seed 0."""
NEEDED_BY = {"amb-calibration": ("tsbs12", "force-constant"), "bearing-model": ("amb5dof", "unbalance")}
THEN = {
    "amb-calibration": {
        "K@inboard": ("K_i", 75.40476500156576, 0.19492621851847272),
        "K2@outboard": ("K2_o", -0.5243391323163991, 0.0355500865113455),
        "K@inboard, 1": ("K_i@1", 75.42728778781404, 0.2084604083210684),
    },
    "bearing-model": {
        "beta@yi": ("beta_yi", 7.237658014668108e-07, 1.226075441932271e-08),
        "offset@zo": ("offset_zo", 0.00011354053510154161, 1.915561028999778e-06),
    },
}
"""By kind and place: the name of then, value and standard uncertainty, as that commit read them."""


def taken(name: str, folder: Path) -> tuple[RigFile, Calibration]:
    """The calibration as a run that needs it is given it, on the day on which it was made."""
    rig = load_rig(NEEDED_BY[name][0])
    store = Store.of(rig, 0, folder)
    store.folder.mkdir(parents=True)
    shutil.copy(FORMER / f"{name}.json", store.path(name))
    made = datetime.fromisoformat(read(store.path(name)).date)
    procedure = load_procedure(NEEDED_BY[name][1])
    plan = procedure.plan.model_validate(rig.plans.get(procedure.name, {}))
    (found,) = Lookup(store, rig, made, lambda need: need.procedure).found(procedure.name, procedure.needs(plan))
    return rig, found


@pytest.mark.parametrize("name", THEN)
def test_it_is_taken_and_says_the_same_by_both_names(tmp_path: Path, name: str) -> None:
    rig, found = taken(name, tmp_path / "calibrations")
    rig_files = {"rig.toml": rig.toml_text.encode(), "rig.dbc": rig.dbc_text.encode()}
    stored = {**HEADER.attachments, **rig_files, "calibrations.json": attachment([found]).encode()}
    record(tmp_path / "a.mcap", [], header=RunHeader(HEADER.metadata, stored))
    known = Recording.open(tmp_path / "a.mcap").calibration(name).values
    for full, (own, value, u) in THEN[name].items():
        assert known[full] is known[own]
        assert (known[own].value, known[own].u) == (value, u)
