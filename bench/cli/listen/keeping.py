"""A recording of what was heard: a run directory with the recording alone, which `bench export` opens."""

from __future__ import annotations

import socket
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from bench import rundir
from bench.clock import Clock
from bench.recording.recorder import Recorder, RunHeader
from bench.rigfile import RigFile
from bench.run.provenance import now, versions
from bench.samples import StreamLayout


@contextmanager
def keeping(
    rig: RigFile, out: Path, clock: Clock, streams: Sequence[StreamLayout]
) -> Iterator[tuple[rundir.RunDirectory, Recorder]]:
    """A new run directory in `out` and what records into it, for the block.

    Raises:
        ConfigError: no directory can be made there.
        RecordingError: the recording cannot be written.
    """
    started = datetime.now(UTC)
    directory = rundir.create(out, rundir.LISTENED, started)
    header = RunHeader(
        metadata={
            "run": {"procedure": rundir.LISTENED, "rig": rig.name, "backend": "live", "seed": ""},
            "versions": versions(),
        },
        attachments={"rig.toml": rig.toml_text.encode(), "rig.dbc": rig.dbc_text.encode()},
    )
    with Recorder(directory.recording, clock=clock, streams=streams, header=header, live=True) as recorder:
        try:
            yield directory, recorder
        finally:
            recorder.wall |= {
                "run_id": directory.run_id, "host": socket.gethostname(), "started": started.isoformat(timespec="seconds"),
                "ended": now(), "rig_file": str(Path(rig.path).resolve()),
            }  # fmt: skip
