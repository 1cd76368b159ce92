"""Provenance: what the recording says of itself, apart from what differs between two runs of one seed and visit."""

from __future__ import annotations

import json
import platform
import socket
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from bench import extensions
from bench.calibration.file import attachment
from bench.procedure import Origin, Procedure
from bench.procedure.origin import ATTACHED
from bench.recording import storedplan
from bench.recording.recorder import RunHeader
from bench.rigfile import RigFile
from bench.run.job import Job
from bench.rundir import RunDirectory

NAMED_VERSIONS = ("levbench", "numpy", "scipy", "mcap", "cantools", "pydantic")


def versions(procedure: Procedure | None = None, rig: RigFile | None = None) -> dict[str, str]:
    """Versions of Python and of what takes part in the numbers: with a procedure and a rig also of the packages that these are
    from, and the digest of a procedure's file."""
    found = {"python": platform.python_version()}
    for name in NAMED_VERSIONS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "unknown"
    if procedure is not None and procedure.origin is not None:
        found[procedure.origin.name] = procedure.origin.version
    return found | ({} if rig is None else _of_rig(rig))


def _of_rig(rig: RigFile) -> dict[str, str]:
    """The packages that a rig's simulated machine, and what its links are opened by, are from."""
    asked = [(extensions.MACHINES, str(rig.simulation.get("machine", "")))]
    schemes = [link.url.partition(":")[0].lower() for link in rig.links.values()]
    asked += [(group, scheme) for scheme in schemes for group in (extensions.LINKS, extensions.DEVICES)]
    return {p.package: p.version for group, name in asked for p in extensions.points(group) if p.name == name}


def header(job: Job) -> RunHeader:
    """Rig file, plan, limits, calibrations, versions, seed and visit, as they stand first in the file. Visit 0 is not said, so
    that its recordings are those of before there were visits."""
    seed = "" if job.seed is None else str(job.seed)
    limits = {name: asdict(limit) for name, limit in job.limits.items()}
    visit = {"visit": str(job.visit)} if job.visit else {}
    asked = {"verdict": "required"} if job.require_verdict else {}
    origin = job.procedure.origin
    foreign = {} if origin is None else {"procedure_from": str(origin)}
    return RunHeader(
        metadata={
            "run": {
                "procedure": job.procedure.name,
                "rig": job.rig.name,
                "backend": job.backend,
                "seed": seed,
                **visit,
                **asked,
                **foreign,
            },
            "versions": versions(job.procedure, job.rig),
        },
        attachments={
            "rig.toml": job.rig.toml_text.encode(),
            "rig.dbc": job.rig.dbc_text.encode(),
            "plan.json": storedplan.written(job.plan).encode(),
            "spec.json": json.dumps(limits, sort_keys=True).encode(),
            "calibrations.json": attachment(job.calibrations).encode(),
            **({ATTACHED: origin.text.encode()} if origin is not None and origin.of_file else {}),
        },
    )


def now() -> str:
    """The wall clock as records carry it: ISO 8601, UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def wall(directory: RunDirectory, started: datetime, rig_file: str, origin: Origin | None = None) -> dict[str, str]:
    """What differs between two runs of one seed and visit: dates, names, durations, where the rig file lay, and the procedure's
    where that is one."""
    took = (datetime.now(UTC) - started).total_seconds()
    return {
        "run_id": directory.run_id, "host": socket.gethostname(), "started": started.isoformat(timespec="seconds"),
        "ended": now(), "duration_s": f"{took:.3f}", "rig_file": str(Path(rig_file).resolve()),
        **({"procedure_file": origin.path} if origin is not None and origin.path else {}),
    }  # fmt: skip
