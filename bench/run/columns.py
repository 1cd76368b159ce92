"""The columns of exported tables: one naming for every format.

Samples have `t_s` (seconds since the first sample of the telemetry), `t_ns`, `index` and `tick`, then their channels by name,
SI, then `step` and `step_kind`: which step of the table of steps they lie in, the innermost one, nothing outside of all.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from bench.errors import AnalysisError
from bench.recording import Recording
from bench.recording.layout import DecodedBlock
from bench.recording.steps import Step
from bench.samples import StreamLayout

ROW_GROUP: Final = 1 << 16
"""Rows of a Parquet row group: a minute at 1 kHz."""
TYPES: Final = {"f4": pa.float32(), "f8": pa.float64(), "u2": pa.uint32()}
EVENTS: Final = pa.schema([("t_s", pa.float64()), ("t_ns", pa.int64()), ("kind", pa.string()), ("data", pa.string())])
STEPS: Final = ("step", "kind", "start_s", "end_s", "start_ns", "end_ns")
Int = npt.NDArray[np.int64]


def origin_ns(recording: Recording[Any]) -> int:
    """What `t_s` counts from: the first sample of the telemetry, of any stream where none was recorded, 0 where nothing was."""
    try:
        return recording.start_ns
    except AnalysisError:
        firsts = (next(iter(recording.blocks(name)), None) for name in recording.streams)
        return min((int(block.t_ns[0]) for block in firsts if block is not None), default=0)


def schema_of(stream: StreamLayout) -> pa.Schema:
    """The columns of a stream's samples; the field's metadata have the unit."""
    head = [
        pa.field("t_s", pa.float64(), metadata={"unit": "s"}),
        pa.field("t_ns", pa.int64(), metadata={"unit": "ns"}),
    ]
    count = [pa.field("index", pa.int64()), pa.field("tick", pa.uint64())]
    channels = [pa.field(c.name, TYPES[c.dtype], metadata={"unit": c.unit}) for c in stream.channels]
    return pa.schema([*head, *count, *channels, pa.field("step", pa.int32()), pa.field("step_kind", pa.string())])


def batches(recording: Recording[Any], stream: StreamLayout) -> Iterator[pa.RecordBatch]:
    """The samples of a stream, a batch for each block."""
    schema, origin, steps = schema_of(stream), origin_ns(recording), tuple(recording.all_steps())
    for block in recording.blocks(stream.name):
        yield pa.record_batch(_columns(block, stream, origin, steps), schema=schema)


def _columns(block: DecodedBlock, stream: StreamLayout, origin: int, steps: Sequence[Step]) -> list[Any]:
    index = np.arange(block.first, block.first + block.count, dtype=np.int64)
    within = steps_at(block.t_ns, steps)
    kinds = [steps[k].kind if k >= 0 else None for k in within.tolist()]
    head = [(block.t_ns - origin) / 1e9, block.t_ns, index, block.ticks]
    number = pa.array(within, pa.int32(), mask=within < 0)
    return [
        *map(pa.array, (*head, *(block.columns[c.name] for c in stream.channels))),
        number,
        pa.array(kinds, pa.string()),
    ]


def steps_at(t_ns: npt.NDArray[np.int64], steps: Sequence[Step]) -> Int:
    """Of each time (n,), the number (n,) of the innermost step around it, -1 where there is none. Times ascend, and steps are
    in the order of their beginning: an inner one comes after the one around it."""
    found = np.full(len(t_ns), -1, np.int64)
    for number, step in enumerate(steps):
        if len(t_ns) and step.start_ns <= t_ns[-1] and step.end_ns > t_ns[0]:
            first, last = np.searchsorted(t_ns, [step.start_ns, step.end_ns])
            found[first:last] = number
    return found


def steps_of(recording: Recording[Any]) -> pa.RecordBatch:
    """The completed steps, a row each: number, kind, beginning and end, and a column for each label that any of them has."""
    steps, origin = tuple(recording.all_steps()), origin_ns(recording)
    starts, ends = [s.start_ns for s in steps], [s.end_ns for s in steps]
    columns: dict[str, pa.Array] = {
        "step": pa.array(range(len(steps)), pa.int32()),
        "kind": pa.array([s.kind for s in steps], pa.string()),
        "start_s": pa.array([(t - origin) / 1e9 for t in starts], pa.float64()),
        "end_s": pa.array([(t - origin) / 1e9 for t in ends], pa.float64()),
        "start_ns": pa.array(starts, pa.int64()),
        "end_ns": pa.array(ends, pa.int64()),
    }
    for name in dict.fromkeys(label for s in steps for label in s.labels):
        told = f"{name}_label" if name in STEPS else name
        columns[told] = _labels([s.labels.get(name) for s in steps])
    return pa.record_batch(columns)


def _labels(values: Sequence[Any]) -> pa.Array:
    """One type a column: truths, numbers, or texts where it is a mixture."""
    there = [v for v in values if v is not None]
    if all(isinstance(v, bool) for v in there):
        return pa.array(values, pa.bool_())
    if all(isinstance(v, int | float) and not isinstance(v, bool) for v in there):
        return pa.array([None if v is None else float(v) for v in values], pa.float64())
    return pa.array([v if v is None or isinstance(v, str) else json.dumps(v) for v in values], pa.string())


def events_of(recording: Recording[Any]) -> pa.RecordBatch:
    """The events, a row each; what each kind tells more is JSON."""
    rows, origin = recording.events(), origin_ns(recording)
    data = [json.dumps({k: v for k, v in e.items() if k not in ("kind", "t_ns")}) for e in rows]
    times = [e["t_ns"] for e in rows]
    return pa.record_batch([[(t - origin) / 1e9 for t in times], times, [e["kind"] for e in rows], data], schema=EVENTS)


def units_of(tables: Mapping[str, pa.Schema]) -> pa.RecordBatch:
    """Which column of which table has which unit, for formats that cannot say it themselves."""
    rows = [
        (table, f.name, (f.metadata or {}).get(b"unit", b"").decode())
        for table, schema in tables.items()
        for f in schema
    ]
    return pa.record_batch(
        {key: pa.array([row[k] for row in rows], pa.string()) for k, key in enumerate(("table", "column", "unit"))}
    )


def row_groups(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.Table]:
    """Batches put together to ROW_GROUP rows: each row group repeats a description of every column."""
    waiting: list[pa.RecordBatch] = []
    for batch in batches:
        waiting.append(batch)
        if sum(b.num_rows for b in waiting) >= ROW_GROUP:
            yield pa.Table.from_batches(waiting)
            waiting = []
    if waiting:
        yield pa.Table.from_batches(waiting)
