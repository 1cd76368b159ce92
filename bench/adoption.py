"""From a run to a calibration: what its results state as facts, of which machine, from when until when."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

from bench import __version__
from bench.calibration import Backend, Calibration, adopted, certificates_of
from bench.errors import ConfigError
from bench.procedure import Procedure
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.uncertainty import Estimate

INTERVAL_DAYS = 365
EPOCH = datetime(2026, 1, 1, tzinfo=UTC)  # when the virtual clock begins


def calibration_of(
    procedure: Procedure, recording: Recording[Any], facts: Mapping[str, Estimate], *, run_id: str,
    began: datetime = EPOCH, outcome: str = "PASS", sha256: str = "", served: bool = False,
) -> Calibration:  # fmt: skip
    """The facts of a run as a calibration of the rig in its recording.

    Raises:
        ConfigError: there are no facts to keep.
    """
    if not facts:
        raise ConfigError(f"run {run_id}: found no results; expected some to adopt")
    rig, seed = recording.rig, recording.seed
    backend: Backend = "sim" if seed is not None else "served" if served else "live"
    known = {identity for c in recording.calibrations for identity in c.influences}
    values = adopted(facts, run_id, known)
    identities = {i.id for e in values.values() for i in e.sensitivities}
    date = began.astimezone(UTC)
    return Calibration(
        procedure=procedure.name, values=values, settings=procedure.holds_for(recording.plan), run_id=run_id,
        date=date.isoformat(timespec="seconds"), due=due(rig, procedure.name, date), rig=rig.name, uut=rig.uut.serial,
        backend=backend, seed=seed, outcome=outcome, sha256=sha256 or hashlib.sha256(run_id.encode()).hexdigest(),
        levbench=recording.versions.get("levbench", __version__),
        used=tuple(c.summary for c in recording.calibrations), certificates=certificates_of(rig, identities),
    )  # fmt: skip


def due(rig: RigFile, procedure: str, made: datetime) -> str:
    """The last day of a calibration: the rig file's interval for the procedure after it was made."""
    table = getattr(rig, "calibration", None)
    days = dict(getattr(table, "interval_days", None) or {}).get(procedure, INTERVAL_DAYS)
    return (made + timedelta(days=days)).date().isoformat()
