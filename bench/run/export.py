"""A run's recording as files for other tools: tables (Parquet, CSV), MDF 4, or MCAP with one scalar message per sample.

Columns are called alike in each: `t_s`, `t_ns`, `index`, `tick`, the channels by their names, and at the end `step` and
`step_kind`. Units stand in `columns.<to>`, and in Parquet with the fields, too.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, Literal

import pyarrow as pa
from mcap.writer import CompressionType, Writer
from pyarrow import csv, parquet

from bench import rundir
from bench.errors import BenchError
from bench.recording import Recording, layout
from bench.run import columns, mdf

Tabular = Literal["parquet", "csv"]
Format = Literal[Tabular, "mcap", "mdf"]


def export(run: Path, to: Format, out: Path | None = None) -> tuple[Path, ...]:
    """Write a run's streams and events into folder `out` (default RUN/export), replacing older exports.

    `parquet` and `csv` give `<stream>.<to>`, `capture-<n>.<to>`, `steps.<to>`, `events.<to>` and `columns.<to>`, which has the
    units; `mdf` gives `samples.mf4`, a channel group for each stream; `mcap` gives `samples.mcap`, where every sample is a
    message of scalars that Foxglove and PlotJuggler plot at full rate. Each file appears whole or not at all. Of a truncated
    recording, what was written before it was cut off.

    Returns:
        the files.

    Raises:
        ConfigError: `run` is no run directory, or what writes MDF is not installed.
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
        if to == "mdf":
            return (whole_file(folder / "samples.mf4", partial(mdf.write, recording)),)
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
    schemas: dict[str, pa.Schema] = {}
    for stream in (*recording.streams.values(), *recording.capture_streams.values()):
        name = stream.name.replace("/", "-")
        schemas[name] = columns.schema_of(stream)
        yield _table(folder / f"{name}.{to}", to, schemas[name], columns.batches(recording, stream))
    for name, rows in (("steps", columns.steps_of(recording)), ("events", columns.events_of(recording))):
        yield whole_table(folder / f"{name}.{to}", to, rows)
    yield whole_table(folder / f"columns.{to}", to, columns.units_of(schemas))


def _table(path: Path, to: Tabular, schema: pa.Schema, batches: Iterator[pa.RecordBatch]) -> Path:
    """In memory of one block at a time, or of one row group."""

    def write(part: Path) -> None:
        if to == "csv":
            with csv.CSVWriter(part, schema) as lines:
                for batch in batches:
                    lines.write_batch(batch)
            return
        with parquet.ParquetWriter(part, schema) as groups:
            for table in columns.row_groups(batches):
                groups.write_table(table, row_group_size=max(table.num_rows, 1))

    return whole_file(path, write)


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
