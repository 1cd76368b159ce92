"""From a run to a calibration: what its results state as facts, of which machine, from when until when.

A run is adopted only if its recording is the one that its record was made from, if this version finds the same numbers in it,
and if the rig file still has the certificates that they rest on.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from bench import __version__, rundir
from bench.calibration import Backend, Calibration, adopted, certificates_of, changed_certificates, facts_of
from bench.calibrationstore import Store
from bench.errors import ConfigError
from bench.evaluation import Ending
from bench.findings import SIMULATED_CONTROLLER
from bench.procedure import Procedure
from bench.recording import Recording
from bench.records import Record, read_record
from bench.rigfile import RigFile
from bench.rundir import RunDirectory
from bench.uncertainty import Estimate

INTERVAL_DAYS = 365
SAME = 1e-3  # of the standard uncertainty: other processors round differently
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
    units = {q.name: q.unit for q in procedure.measures}  # propagation through a function leaves them empty
    named = {name: replace(e, unit=e.unit or units.get(name.partition("@")[0], "")) for name, e in facts.items()}
    values = adopted(named, run_id, known)
    identities = {i.id for e in values.values() for i in e.sensitivities}
    date = began.astimezone(UTC)
    return Calibration(
        procedure=procedure.name, values=values, settings=procedure.holds_for(recording.plan), run_id=run_id,
        date=date.isoformat(timespec="seconds"), due=due(rig, procedure.name, date), rig=rig.name, uut=rig.uut.serial,
        backend=backend, seed=seed, outcome=outcome, sha256=sha256 or hashlib.sha256(run_id.encode()).hexdigest(),
        levbench=recording.versions.get("levbench", __version__),
        used=tuple(c.summary for c in recording.calibrations), certificates=certificates_of(rig, identities),
    )  # fmt: skip


@dataclass(frozen=True)
class Adoption:
    """A run to be adopted: its directory, record and recording."""

    run: RunDirectory
    record: Record
    recording: Recording[Any]
    digest: str

    @classmethod
    def open(cls, path: Path) -> Adoption:
        """The run at `path`, its recording checked against its record.

        Raises:
            ConfigError: no run, or a recording that is not the record's.
            RecordingError: no recording, or a damaged one.
        """
        run = rundir.existing(path)
        record = read_record(run.record)
        if not run.recording.is_file() or record.recording is None or record.recording.sha256 is None:
            raise ConfigError(
                f"{path}: its record knows no recording; expected one. A run that ended early is not adopted"
            )
        recording: Recording[Any] = Recording.open(run.recording)
        if (digest := recording.digest()) != record.recording.sha256:
            raise ConfigError(
                f"{run.recording}: found sha256 {digest}; the record was made from {record.recording.sha256}. This is another "
                f"recording, or it was changed. Next: `bench run {record.procedure}` again"
            )
        return cls(run, record, recording, digest)

    def calibration(self, procedure: Procedure, anyway: bool = False) -> Calibration:
        """The run's facts as a calibration. `anyway` takes a run that ended neither PASS nor DONE, as long as it has results.

        Raises:
            ConfigError: its outcome, or numbers that are not those of the record.
            BenchError: the analysis fails.
        """
        record, where = self.record, self.run.path
        if not record.outcome.sound and not anyway:
            raise ConfigError(
                f"{where}: found outcome {record.outcome.value}; expected PASS or DONE. Next: look at its report, or adopt it "
                "with --anyway, and the calibration says so"
            )
        if Ending.read(self.recording).stopped is not None:
            raise ConfigError(f"{where}: the run was stopped before its end; expected a completed one")
        recording: Recording[Any] = Recording.open(self.run.recording, procedure.plan)
        facts = facts_of(procedure, recording)
        served = any(f.code == SIMULATED_CONTROLLER for f in record.findings)
        made = calibration_of(
            procedure, recording, facts, run_id=record.run_id, began=datetime.fromisoformat(record.started),
            outcome=record.outcome.value, sha256=self.digest, served=served,
        )  # fmt: skip
        self._same_numbers(facts)
        return made

    def _same_numbers(self, facts: Mapping[str, Estimate]) -> None:
        """Raises ConfigError where the facts are not what the record's verdict was about."""
        for m in self.record.measurements:
            fact = facts.get(m.name + (f"@{m.where}" if m.where else ""))
            uncertainty = m.standard_uncertainty or m.expanded_uncertainty
            if fact is None or m.value is None or not uncertainty:
                continue
            if abs(fact.value - m.value) > SAME * uncertainty:
                raise ConfigError(
                    f"{self.run.path}: {m.name}: this version finds {fact.value:.8g}; the record has {m.value:.8g}. "
                    f"Next: `bench run {self.record.procedure}` again, or adopt it with Levbench "
                    f"{self.record.versions.get('levbench', 'of that time')}"
                )


def refuse_other_rig(calibration: Calibration, rig: RigFile, store: Store) -> None:
    """Raises ConfigError if a calibration is not of that rig, or rests on certificates that its file does not have now."""
    if foreign := store.foreign(calibration):
        raise ConfigError(f"{calibration.run_id}: the run is {foreign}. Next: give its rig file with --rig")
    if changed := changed_certificates(calibration.certificates, rig):
        title = f"{calibration.run_id}: made with other certificates than {rig.path} has now; nothing was adopted:"
        raise ConfigError(
            "\n  ".join([title, *changed, f"next: `bench run {calibration.procedure}` with this rig file"])
        )


def due(rig: RigFile, procedure: str, made: datetime) -> str:
    """The last day of a calibration: the rig file's interval for the procedure after it was made."""
    days = rig.calibration.interval_days.get(procedure, INTERVAL_DAYS)
    return (made + timedelta(days=days)).date().isoformat()
