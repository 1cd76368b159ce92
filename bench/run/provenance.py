"""Provenance: what the recording says of itself, apart from what differs between two runs of one seed and visit."""

from __future__ import annotations

import json
import platform
import socket
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from bench.calibration.file import attachment
from bench.recording import storedplan
from bench.recording.recorder import RunHeader
from bench.run.job import Job
from bench.rundir import RunDirectory

NAMED_VERSIONS = ("levbench", "numpy", "scipy", "mcap", "cantools", "pydantic")


def versions() -> dict[str, str]:
    """Versions of Python and of what takes part in the numbers."""
    found = {"python": platform.python_version()}
    for name in NAMED_VERSIONS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "unknown"
    return found


def header(job: Job) -> RunHeader:
    """Rig file, plan, limits, calibrations, versions, seed and visit, as they stand first in the file. Visit 0 is not said, so
    that its recordings are those of before there were visits."""
    seed = "" if job.seed is None else str(job.seed)
    limits = {name: asdict(limit) for name, limit in job.limits.items()}
    visit = {"visit": str(job.visit)} if job.visit else {}
    asked = {"verdict": "required"} if job.require_verdict else {}
    return RunHeader(
        metadata={
            "run": {
                "procedure": job.procedure.name,
                "rig": job.rig.name,
                "backend": job.backend,
                "seed": seed,
                **visit,
                **asked,
            },
            "versions": versions(),
        },
        attachments={
            "rig.toml": job.rig.toml_text.encode(),
            "rig.dbc": job.rig.dbc_text.encode(),
            "plan.json": storedplan.written(job.plan).encode(),
            "spec.json": json.dumps(limits, sort_keys=True).encode(),
            "calibrations.json": attachment(job.calibrations).encode(),
        },
    )


def now() -> str:
    """The wall clock as records carry it: ISO 8601, UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def wall(directory: RunDirectory, started: datetime, rig_file: str) -> dict[str, str]:
    """What differs between two runs of one seed and visit: dates, names, durations, where the rig file lay."""
    took = (datetime.now(UTC) - started).total_seconds()
    return {
        "run_id": directory.run_id, "host": socket.gethostname(), "started": started.isoformat(timespec="seconds"),
        "ended": now(), "duration_s": f"{took:.3f}", "rig_file": str(Path(rig_file).resolve()),
    }  # fmt: skip
