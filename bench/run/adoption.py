"""From a run to a calibration: what its results state as facts, of which machine, from when until when.

A run is adopted only if its recording is the one that its record was made from, if this version finds in it the outcome,
the times and the numbers of the record, and if the rig file still has the certificates that they rest on.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from bench import __version__, rundir
from bench.calibration import Backend, Calibration, adopted, certificates_of, changed_certificates
from bench.calibration.store import Store
from bench.errors import ConfigError
from bench.findings import SIMULATED_CONTROLLER
from bench.procedure import Procedure
from bench.record.records import Record, read_record
from bench.recording import Recording
from bench.rigfile import RigFile
from bench.rigfile.certificates import certified_numbers
from bench.run.agreement import outcome_of_both, require_agreement
from bench.run.evaluation import Ending
from bench.run.reanalysis import reanalysed
from bench.rundir import RunDirectory
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
    declared = (*procedure.on(rig).measures, *procedure.measures)
    units = {q.name: q.unit for q in declared}  # propagation through a function leaves them empty
    named = {name: replace(e, unit=e.unit or units.get(name.partition("@")[0], "")) for name, e in facts.items()}
    values = adopted(named, run_id, known, certified_numbers(rig))
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

    def calibration(self, procedure: Procedure, anyway: bool = False, now: datetime | None = None) -> Calibration:
        """The run's facts as a calibration, by what its recording gives; `now` is the time of the adoption, by default the
        host's. `anyway` takes a run that ended neither PASS nor DONE, as long as it has results.

        Raises:
            ConfigError: its outcome, a record that contradicts its recording, or a date in the future.
            BenchError: the analysis fails.
        """
        where = self.run.path
        recording: Recording[Any] = Recording.open(self.run.recording, procedure.plan)
        again = reanalysed(self.run, procedure, recording, self.record)
        require_agreement(where, self.record, again, recording.versions.get("levbench", "of that time"))
        outcome = outcome_of_both(self.record, again)
        if not outcome.sound and not anyway:
            raise ConfigError(
                f"{where}: found outcome {outcome.value}; expected PASS or DONE. Next: look at its report, or adopt it "
                "with --anyway, and the calibration says so"
            )
        if Ending.read(recording).stopped is not None:
            raise ConfigError(f"{where}: the run was stopped before its end; expected a completed one")
        served = any(f.code == SIMULATED_CONTROLLER for f in again.findings)
        made = calibration_of(
            procedure, recording, procedure.stated(recording), run_id=again.run_id,
            began=datetime.fromisoformat(again.started), outcome=outcome.value, sha256=self.digest, served=served,
        )  # fmt: skip
        refuse_the_future(where, made, now or datetime.now(UTC))
        return made


def refuse_the_future(where: Path, made: Calibration, now: datetime) -> None:
    """Raises ConfigError if a run began after `now`: its due date would be too late."""
    if made.ahead(now):
        raise ConfigError(
            f"{where}: the run began on {made.date}; this computer's clock says {now.astimezone(UTC):%Y-%m-%dT%H:%M:%S+00:00}; "
            f"expected a date that is past. Next: set the clock, and if it was wrong then, `bench run {made.procedure}` again"
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
