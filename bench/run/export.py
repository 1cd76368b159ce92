"""A run's recording as files for other tools: tables (Parquet, CSV), or MCAP with one scalar message per sample."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import pyarrow as pa
from mcap.writer import CompressionType, Writer
from pyarrow import csv, parquet

from bench import rundir
from bench.errors import BenchError
from bench.recording import Recording, layout
from bench.samples import StreamLayout

Tabular = Literal["parquet", "csv"]
Format = Literal[Tabular, "mcap"]
ROW_GROUP: Final = 1 << 16
"""Rows of a Parquet row group: a minute at 1 kHz."""
EVENTS: Final = pa.schema([("t_ns", pa.int64()), ("kind", pa.string()), ("data", pa.string())])


def export(run: Path, to: Format, out: Path | None = None) -> tuple[Path, ...]:
    """Write a run's streams and events into folder `out` (default RUN/export), replacing older exports.

    `parquet` and `csv` give `<stream>.<to>`, `capture-<n>.<to>` and `events.<to>`; `mcap` gives `samples.mcap`, where every
    sample is a message of scalars that Foxglove and PlotJuggler plot at full rate. Each file appears whole or not at all. Of a
    truncated recording, what was written before it was cut off.

    Returns:
        the files.

    Raises:
        ConfigError: `run` is no run directory.
        RecordingError: the recording cannot be read.
        BenchError: a file cannot be written.
    """
    directory = rundir.existing(run)
    recording: Recording[Any] = Recording.open(directory.recording)
    folder = directory.path / "export" if out is None else out
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if to == "mcap":
            return (whole_file(folder / "samples.mcap", lambda part: _write_mcap(part, recording)),)
        return tuple(_tables(folder, to, recording))
    except OSError as error:
        raise BenchError(f"{folder}: cannot be written: {error.strerror or error}; the run is untouched") from error


def whole_file(path: Path, write: Callable[[Path], object]) -> Path:
    """A file that is there only once it is complete.

    Raises:
        OSError: it cannot be written.
    """
    part = path.with_name(path.name + ".part")
    try:
        write(part)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)
    return path


def whole_table(path: Path, to: Tabular, rows: pa.RecordBatch) -> Path:
    """One batch as a file that is there only once it is complete.

    Raises:
        OSError: it cannot be written.
    """
    return _table(path, to, rows.schema, iter([rows]))


def _tables(folder: Path, to: Tabular, recording: Recording[Any]) -> Iterator[Path]:
    for stream in (*recording.streams.values(), *recording.capture_streams.values()):
        schema = _schema(stream, with_units=to == "csv")
        yield _table(folder / f"{stream.name.replace('/', '-')}.{to}", to, schema, _batches(recording, stream, schema))
    yield whole_table(folder / f"events.{to}", to, _events(recording))


def _table(path: Path, to: Tabular, schema: pa.Schema, batches: Iterator[pa.RecordBatch]) -> Path:
    """In memory of one block at a time, or of one row group."""

    def write(part: Path) -> None:
        if to == "csv":
            with csv.CSVWriter(part, schema) as lines:
                for batch in batches:
                    lines.write_batch(batch)
            return
        with parquet.ParquetWriter(part, schema) as groups:
            for table in _row_groups(batches):
                groups.write_table(table, row_group_size=max(table.num_rows, 1))

    return whole_file(path, write)


def _row_groups(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.Table]:
    """Batches put together to ROW_GROUP rows: each row group repeats a description of every column."""
    waiting: list[pa.RecordBatch] = []
    for batch in batches:
        waiting.append(batch)
        if sum(b.num_rows for b in waiting) >= ROW_GROUP:
            yield pa.Table.from_batches(waiting)
            waiting = []
    if waiting:
        yield pa.Table.from_batches(waiting)


def _schema(stream: StreamLayout, *, with_units: bool) -> pa.Schema:
    """Sample time (UNIX ns), index (lost samples counted too), device tick, and the channels in SI.

    Parquet keeps the unit as metadata of the field; CSV can only carry it in the heading.
    """
    head = [pa.field("t_ns", pa.int64()), pa.field("index", pa.int64()), pa.field("tick", pa.uint64())]
    for c in stream.channels:
        name = f"{c.name} [{c.unit}]" if with_units and c.unit not in ("", "1") else c.name
        kind = {"f4": pa.float32(), "f8": pa.float64(), "u2": pa.uint32()}[c.dtype]
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


def _write_mcap(part: Path, recording: Recording[Any]) -> None:
    """One message per sample and the events. It is no recording of ours: the profile is left empty, so that nobody
    takes it for the evidence."""
    with part.open("wb") as file:
        writer: Any = Writer(file, compression=CompressionType.LZ4, enable_data_crcs=True)
        writer.start(profile="", library="levbench")
        writer.add_metadata("expanded-from", {"file": recording.path.name, "sha256": recording.digest()})
        for stream in (*recording.streams.values(), *recording.capture_streams.values()):
            kind = layout.type_name("Sample", stream.name)
            schema = writer.register_schema(f"levbench.{kind}", "protobuf", layout.sample_schema(stream))
            units = {c.name: c.unit for c in stream.channels}
            channel = writer.register_channel(layout.sample_topic(stream.name), "protobuf", schema, units)
            for block in recording.blocks(stream.name):
                rows = layout.encode_scalars([block.columns[c.name] for c in stream.channels])
                for k, (t_ns, row) in enumerate(zip(block.t_ns.tolist(), rows, strict=True)):
                    writer.add_message(channel, t_ns, row, t_ns, (block.first + k) & 0xFFFFFFFF)
        schema = writer.register_schema("levbench.Event", "jsonschema", layout.EVENT_SCHEMA)
        channel = writer.register_channel(layout.EVENTS, "json", schema)
        for event in recording.events():
            writer.add_message(channel, event["t_ns"], json.dumps(event).encode(), event["t_ns"])
        writer.finish()
