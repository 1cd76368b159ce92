"""What stands still while telemetry comes: its counters, or the readings of single channels."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from bench.rigfile import RigFile
from bench.rigfile.binding import HELD
from bench.samples import SampleBlock

STILL_S = 1.0  # what does not move for so long stands
CLOCKS = ("host_age", "pulse_age")  # they run without a sensor
CODES = ("state", "fault", "flags")


class Stillness:
    """Since when tick, sequence and readings have stood, by the host's time of the frames that came.

    Attributes:
        newest_ns: when the last frame of telemetry came, whatever it says.
    """

    def __init__(self) -> None:
        self._tick = self._sequence = -1
        self._tick_ns = self._sequence_ns = self._readings_ns = self.newest_ns = 0
        self._readings: Mapping[str, float] = {}

    def frames(
        self, sequence: npt.NDArray[np.int64], tick: npt.NDArray[np.int64], arrived: npt.NDArray[np.int64]
    ) -> None:
        """Rows as they came, in order of arrival."""
        self.newest_ns = int(arrived[-1])
        if (moved := _last(tick, self._tick)) is not None:
            self._tick, self._tick_ns = int(tick[-1]), int(arrived[moved])
        if (moved := _last(sequence, self._sequence)) is not None:
            self._sequence, self._sequence_ns = int(sequence[-1]), int(arrived[moved])

    def readings(self, latest: Mapping[str, float]) -> None:
        """The newest sample after those rows. What a clock in the controller counts is no reading."""
        if any(self._readings.get(name) != value for name, value in latest.items() if name not in CLOCKS):
            self._readings, self._readings_ns = latest, self.newest_ns

    @property
    def frozen(self) -> str:
        """What has stood for a second while frames came: "tick", "sequence" or both; "" while both go on."""
        stands = [name for name, since in (("tick", self._tick_ns), ("sequence", self._sequence_ns))
                  if self.newest_ns - since >= STILL_S * 1e9]  # fmt: skip
        return " and ".join(stands)

    @property
    def alive(self) -> bool:
        """Whether tick, sequence and some reading or code have moved within the last second of frames."""
        since = min(self._tick_ns, self._sequence_ns, self._readings_ns)
        return since > 0 and self.newest_ns - since < STILL_S * 1e9


def _last(counter: npt.NDArray[np.int64], before: int) -> int | None:
    """Index of the last row in which a counter differs from the one before."""
    if counter[-1] != (counter[-2] if len(counter) > 1 else before):  # as nearly always
        return len(counter) - 1
    moved = np.flatnonzero(np.diff(counter, prepend=before))
    return int(moved[-1]) if len(moved) else None


class StuckChannels:
    """Channels whose readings stood for a second while the rotor was held and the tick went on, `found`. Only those are
    looked at whose noise the rig file states, above one count: others may well read the same. `all_stand`: noise was seen, and
    now all of them stand, two or more."""

    def __init__(self, rig: RigFile) -> None:
        self._names = [name for name in rig.channels if rig.noisy(name)]
        self._held = {c for c, name in rig.choices("state").items() if rig.binding.mode(name) in HELD}
        self._last: npt.NDArray[np.float64] | None = None  # of the block before, while the rotor is held
        self._moved_ns = np.zeros(len(self._names), np.int64)
        self._noise_seen = False
        self.found: set[str] = set()
        self.all_stand = False

    def take(self, block: SampleBlock) -> None:
        """The next samples."""
        if not self._names:
            return
        if not set(block.columns["state"].tolist()) <= self._held:
            self._last, self.all_stand = None, False
            return
        readings = [block.columns[name] for name in self._names]
        if self._last is None:
            self._last = np.array([r[0] for r in readings])
            self._moved_ns[:] = block.t_ns[0]
        newest = np.array([r[-1] for r in readings])
        moved = newest != self._last
        for k in np.flatnonzero(~moved):  # few, as noise is above a count: went and came back?
            moved[k] = bool((readings[k] != self._last[k]).any())
        self._moved_ns[moved] = block.t_ns[-1]
        self._last = newest
        self._noise_seen = self._noise_seen or bool(moved.any())
        still = block.t_ns[-1] - self._moved_ns >= STILL_S * 1e9
        self.all_stand = self._noise_seen and len(still) > 1 and bool(still.all())
        self.found.update(name for name, stands in zip(self._names, still, strict=True) if stands)
