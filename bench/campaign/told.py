"""What a controller is told out of a model that a campaign ended in: its constants by one procedure, as a calibration.

A model has the values whole and of their budgets the largest terms alone. So it serves a need whose values are told to the
controller and enter no budget (`Need.told`); for all else the runs themselves are adopted.
"""

from __future__ import annotations

import hashlib
from datetime import datetime
from pathlib import Path

from pydantic import ValidationError

from bench.calibration import Backend, Calibration
from bench.calibration.store import named
from bench.campaign.model import MODEL, SCHEMA, Constant, Model
from bench.errors import ConfigError
from bench.rigfile import RigFile
from bench.schema import require_schema
from bench.uncertainty import Estimate, Influence


def read(path: Path) -> tuple[Model, str]:
    """A model and the SHA-256 of its file.

    Raises:
        ConfigError: it cannot be read, or is no model that this version knows.
    """
    try:
        data = path.read_bytes()
        text = data.decode("utf-8")
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}; expected the model.json of a campaign") from error
    require_schema(text, str(path), "model", SCHEMA)
    try:
        model = MODEL.validate_json(text)
    except ValidationError as error:
        listed = [f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors(include_url=False)]
        raise ConfigError("\n  ".join([f"{path}: not a model of schema {SCHEMA}:", *listed])) from error
    for c in model.constants:
        if not _dated(c) or min(c.standard_uncertainty or 0.0, c.expanded_uncertainty) < 0:
            found = f"date {c.date!r}, u = {c.standard_uncertainty}, U = {c.expanded_uncertainty}"
            raise ConfigError(
                f"{path}: {c.name}: found {found}; expected a time with its zone, and no uncertainty below 0"
            )
    return model, hashlib.sha256(data).hexdigest()


def _dated(c: Constant) -> bool:
    try:
        return datetime.fromisoformat(c.date).tzinfo is not None
    except ValueError:
        return False


def refusals(model: Model, rig: RigFile, seed: int | None) -> list[str]:
    """Why a model is not of this machine, or of its rig file as it is now; nothing where it is. `seed` None is no virtual
    rig; whether a controller is a simulated one the run asks it itself."""
    serial = str(model.uut.get("serial", ""))
    if model.rig != rig.name:
        return [f"of rig {model.rig}; this is {rig.name}"]
    if serial != rig.uut.serial:
        return [f"of the machine with serial no. {serial}; this is {rig.uut.serial}"]
    if model.seed != seed:
        return [f"of {named(model.seed)}; this is {named(seed)}"]
    if model.rig_sha256 != rig.digest:
        return [f"made with another rig file (SHA-256 {model.rig_sha256[:12]}; it is {rig.digest[:12]} now). Next: "
                "`bench adopt` the run of that campaign, which compares certificate by certificate"]  # fmt: skip
    return []


def calibration(model: Model, procedure: str, sha256: str, due: str = "9999-12-31") -> Calibration | None:
    """The constants by one procedure; None where the model has none by it. `sha256` is that of the model's file, as a
    certificate's."""
    some = [c for c in model.constants if c.procedure == procedure]
    if not some:
        return None
    first = some[0]
    backend: Backend = "sim" if model.seed is not None else "served" if model.simulated else "live"
    return Calibration(
        procedure=procedure, values={c.name: _estimate(c, sha256) for c in some}, settings=dict(first.holds_for),
        run_id=first.run_id, date=first.date, due=due, rig=model.rig, uut=str(model.uut.get("serial", "")),
        backend=backend, seed=model.seed, outcome="DONE", sha256=sha256, sealed=False,
    )  # fmt: skip


def _estimate(c: Constant, sha256: str) -> Estimate:
    """With all of its uncertainty as one influence: a model does not have the whole budget."""
    u = c.expanded_uncertainty / 2 if c.standard_uncertainty is None else c.standard_uncertainty
    whole = Influence(f"{c.run_id}/{c.name}", f"{c.name} [{c.run_id}]", u, c.unit, "B", "normal",
                      source=f"{c.name} of a model, SHA-256 {sha256}")  # fmt: skip
    return Estimate.of(c.value, whole)
