"""What was heard of a controller by listening alone: frames by identifier, readings by channel, counters, clocks."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from bench.link.census import Census
from bench.link.counting import Counting
from bench.link.frames import FrameBatch
from bench.link.link import LinkStats
from bench.link.readings import Readings
from bench.link.telemetry import TelemetryDecoder
from bench.rigfile import RigFile
from bench.samples import SampleBlock

APART = 0.1
"""Share by which a rate or a tick may be off before it is told."""


@dataclass(frozen=True)
class Ear:
    """How and since when is listened: the link's name and URL, the transport's words for it, what an adapter complains of."""

    link: str
    url: str
    manner: str
    started_ns: int
    complaint: str = ""


@dataclass
class Listened:
    """Everything heard since the start; `now_ns` is the host's time of the last look, `stats` the transport's counts then."""

    rig: RigFile
    ear: Ear
    stats: LinkStats = field(default_factory=LinkStats)
    now_ns: int = 0
    frames: int = 0

    def __post_init__(self) -> None:
        self.now_ns = self.ear.started_ns
        self.census = Census(self.rig)
        self.readings = Readings(self.rig)
        self.counting = Counting(self.rig)
        self.decoder = TelemetryDecoder(self.rig)

    def take(self, batch: FrameBatch, stats: LinkStats, now_ns: int) -> list[SampleBlock]:
        """What came since the last look; the samples that it makes, none while the counters contradict DBC or rig file."""
        self.stats, self.now_ns = stats, now_ns
        if not len(batch):
            return []
        self.frames += len(batch)
        self.census.take(batch)
        self.readings.take(batch)
        self.counting.take(batch)
        return self.decoder.decode(batch) if self.consistent else []

    @property
    def seconds(self) -> float:
        """Since the start."""
        return (self.now_ns - self.ear.started_ns) * 1e-9

    @property
    def due_hz(self) -> float:
        """Samples a second by the DBC."""
        return 1e9 / self.decoder.period_ns

    @property
    def rate_hz(self) -> float:
        """Samples a second of late, by the message that counts them."""
        tally = self.census.of(self.census.telemetry[0])
        return 0.0 if tally is None else tally.rate_hz(self.now_ns)

    @property
    def mean_hz(self) -> float:
        """The same over all that was heard."""
        tally = self.census.of(self.census.telemetry[0])
        return 0.0 if tally is None else tally.mean_hz

    @property
    def silent_s(self) -> float:
        """How long no telemetry has come; infinite where none ever did."""
        came = [t.last_ns for m in self.census.telemetry if (t := self.census.of(m)) is not None]
        return max(0.0, (self.now_ns - max(came)) * 1e-9) if came else math.inf

    @property
    def consistent(self) -> bool:
        """Whether sequence and tick go on from sample to sample as DBC and rig file say; what is counted as lost or twice means
        nothing otherwise. True as long as too few came."""
        b, steps = self.rig.binding, self.counting.steps
        ticks = 1 / (self.due_hz * self.rig.devices["controller"].tick_s)
        return not steps or (steps[b.sequence] == 1 and abs(steps[b.tick] / ticks - 1) <= APART)

    @property
    def drift_ppm(self) -> tuple[float, float] | None:
        """Host's clock against the controller's tick, positive where the host's is faster, and U at 95 %; None where it is
        not known, as in the first five seconds."""
        line = self.decoder.host.rate.line()
        if line is None or not math.isfinite(line.expanded):
            return None
        return line.slope * 1e6, line.expanded * 1e6

    @property
    def tick_s(self) -> float | None:
        """Length of a tick by the host's clock; None where the sequence does not go on by one, or the tick stands."""
        b, steps = self.rig.binding, self.counting.steps
        step = steps.get(b.tick, 0)
        if steps.get(b.sequence) != 1 or step <= 0 or not self.mean_hz:
            return None
        return 1 / (self.mean_hz * step)
