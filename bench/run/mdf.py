"""A recording as MDF 4 (ASAM), for CANape, INCA and MATLAB: a channel group for each stream, its time as master, SI units.

`asammdf` writes it, an extra: nobody else needs it.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from bench.errors import ConfigError
from bench.recording import Recording
from bench.run import columns
from bench.samples import StreamLayout

if TYPE_CHECKING:
    from asammdf import MDF

OUTSIDE = -1  # of `step`, where MDF has no empty cell


def write(recording: Recording[Any], path: Path) -> None:
    """Write every stream and capture of a recording. Kinds of steps, which are texts, are left out; `step` is -1 outside of
    steps.

    Raises:
        ConfigError: asammdf is not installed.
        OSError: the file cannot be written.
    """
    try:
        from asammdf import MDF
    except ImportError as error:
        raise ConfigError(
            "--to mdf: found no asammdf; expected the extra that writes MDF. Next: pip install 'levbench[mdf]'"
        ) from error
    with MDF(version="4.10") as file:
        file.header.start_time = datetime.fromtimestamp(columns.origin_ns(recording) / 1e9, UTC)
        for stream in (*recording.streams.values(), *recording.capture_streams.values()):
            _add(file, recording, stream)
        with path.open("wb") as out:
            file.save(out)


def _add(file: MDF, recording: Recording[Any], stream: StreamLayout) -> None:
    from asammdf import Signal

    group: int | None = None
    units = {c.name: c.unit for c in stream.channels}
    for t_s, samples in _parts(recording, stream):
        if group is None:
            signals = [Signal(x, t_s, unit=units.get(name, ""), name=name) for name, x in samples.items()]
            group = file.append(signals, acq_name=stream.name, comment="levbench", common_timebase=True)
        else:
            file.extend(group, [(t_s, None), *((x, None) for x in samples.values())])


def _parts(
    recording: Recording[Any], stream: StreamLayout
) -> Iterator[tuple[npt.NDArray[np.float64], dict[str, npt.NDArray[Any]]]]:
    """Times and samples by channel, some ten thousand at once."""
    for table in columns.row_groups(columns.batches(recording, stream)):
        whole: pa.Table = table.drop_columns(["t_s", "step_kind", "step"])
        step = table["step"].fill_null(OUTSIDE).to_numpy()
        yield table["t_s"].to_numpy(), {**{name: whole[name].to_numpy() for name in whole.column_names}, "step": step}
