"""`bench export`: the recorded channels of a run as tables for other tools."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import csv, parquet

from bench import rundir
from bench.errors import BenchError
from bench.recording import Recording
from bench.samples import StreamLayout


def export_command(run: Path, to: str) -> int:
    """Write `RUN/export/<stream>.<to>` for each stream and `events.<to>`, replacing older ones.

    Raises:
        ConfigError: it is no run directory.
        RecordingError: the recording cannot be read.
        BenchError: a table cannot be written.
    """
    directory = rundir.existing(run)
    recording: Recording[Any] = Recording.open(directory.recording)
    folder = directory.path / "export"
    try:
        folder.mkdir(exist_ok=True)
        for stream in recording.streams.values():
            schema = _schema(stream, with_units=to == "csv")
            _write(folder / f"{stream.name}.{to}", schema, _batches(recording, stream, schema))
        _write(folder / f"events.{to}", EVENTS, iter([_events(recording)]))
    except OSError as error:
        raise BenchError(f"{folder}: cannot be written: {error.strerror or error}; the run is untouched") from error
    if recording.truncated:
        sys.stderr.write("bench: the recording is truncated: the tables hold what was written before it was cut off\n")
    sys.stdout.write(f"{folder}\n")
    return 0


EVENTS = pa.schema([("t_ns", pa.int64()), ("kind", pa.string()), ("data", pa.string())])


def _schema(stream: StreamLayout, *, with_units: bool) -> pa.Schema:
    """Sample time (UNIX ns), index (lost samples counted too), device tick, and the channels in SI.

    Parquet keeps the unit as metadata of the field; CSV can only carry it in the heading.
    """
    head = [pa.field("t_ns", pa.int64()), pa.field("index", pa.int64()), pa.field("tick", pa.uint64())]
    for c in stream.channels:
        name = f"{c.name} [{c.unit}]" if with_units and c.unit not in ("", "1") else c.name
        kind = pa.float32() if c.dtype == "f4" else pa.uint32()
        head.append(pa.field(name, kind, metadata={"unit": c.unit}))
    return pa.schema(head)


def _batches(recording: Recording[Any], stream: StreamLayout, schema: pa.Schema) -> Iterator[pa.RecordBatch]:
    for block in recording.blocks(stream.name):
        index = np.arange(block.first, block.first + block.count, dtype=np.int64)
        columns = [block.t_ns, index, block.ticks, *(block.columns[c.name] for c in stream.channels)]
        yield pa.record_batch([pa.array(column) for column in columns], schema=schema)


def _events(recording: Recording[Any]) -> pa.RecordBatch:
    rows = recording.events()
    data = [json.dumps({k: v for k, v in e.items() if k not in ("kind", "t_ns")}) for e in rows]
    return pa.record_batch([[e["t_ns"] for e in rows], [e["kind"] for e in rows], data], schema=EVENTS)


def _write(path: Path, schema: pa.Schema, batches: Iterator[pa.RecordBatch]) -> None:
    """Whole or not at all, in memory of one block at a time."""
    part = path.with_name(path.name + ".part")
    with csv.CSVWriter(part, schema) if path.suffix == ".csv" else parquet.ParquetWriter(part, schema) as writer:
        for batch in batches:
            writer.write_batch(batch)
    os.replace(part, path)
