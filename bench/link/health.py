"""What a run says about its link: counts for the record, and a finding for everything that a clean link does not do."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import asdict, dataclass, field

from bench.findings import Effect, Finding
from bench.link.clockrate import described
from bench.link.counts import LinkCounts
from bench.link.hosttime import Drift
from bench.link.link import LinkStats
from bench.link.stillness import STILL_S
from bench.link.telemetry import Counters

LATE_S = 0.04  # telemetry that comes later than this is worth a word
DRIFT_PPM, WRONG_PPM = 200.0, 1000.0  # bench.link.hosttime follows no more; no crystal is as wrong as that
BEYOND = 5  # windows of a second in a row
UNKNOWN_S, GAINED_S = 6.0, 0.02  # a rate is known by then; no drift gains that much in five seconds
CHECK = (
    "Steps and samples drift apart. Check tick_s in the rig file and the controller's crystal, or, of a served rig, whether "
    "its computer keeps up"
)
CHECK_SERVED = (
    "Steps and samples drift apart. The controller is a simulated one, and its ticks are right: the computer that serves it "
    "does not keep up with wall time. Look at what else runs there, and at what `bench serve` says"
)
PERIODS, PERIOD_S = 3, 0.02  # of a heartbeat; a longer gap comes near the watchdog


@dataclass(frozen=True)
class Health:
    """Telemetry counters and transport counts at one moment, drift of the clocks, and the greatest lateness."""

    counters: Counters
    stats: LinkStats
    drift: Drift | None
    latest_ns: int
    host_age_s: float = 0.0  # the controller heard no heartbeat for so long
    round_trip_ns: int | None = None  # least time from a request to its answer
    others: Mapping[str, LinkStats] = field(default_factory=dict)  # of the rig's further links
    cut_ns: int = 0  # by so much telemetry had not reached the end of a step when the run went on
    beyond_drift: int = 0  # the last windows in a row in which telemetry was further behind than by drift
    unknown_s: float = 0.0  # so long telemetry came, and the rate of the controller's clock is not known
    gained_ns: int = 0  # so much earlier than ever telemetry came in the last five seconds
    repeats: int = 0  # requests that were sent again because no reply had come
    replies_wrong_length: int = 0  # frames of a wrong length that are no telemetry (Dialogue.wrong_length)
    simulated: bool = False  # the controller says that it is a simulated one
    stuck: Collection[str] = ()  # channels that read the same for a second while the rotor was held

    @property
    def wrong_length(self) -> int:
        """Telemetry and replies whose length is not that of the DBC."""
        return self.counters.wrong_length + self.replies_wrong_length

    def counts(self, frames: int) -> LinkCounts:
        """As the record has it; `frames` is how many were recorded, in both directions."""
        c, s = self.counters, self.stats
        named = {**asdict(c), **asdict(s), "wrong_length": self.wrong_length, "repeats": self.repeats}
        errors = self.wrong_length + c.lost + c.late + c.misplaced + c.duplicates + c.reordered + c.unknown + c.reboots
        errors += c.sequence_leaps + c.tick_leaps
        errors += s.crc_errors + s.malformed + s.packets_lost + s.error_frames + s.refused + s.adapter_overruns
        errors += s.overflows + s.bus_off + s.reconnects + self.repeats
        drift = self.drift
        return LinkCounts(frames, c.gaps, errors, named, drift.ppm if drift else None,
                          drift.expanded_ppm if drift else None, self.latest_ns * 1e-6,
                          None if self.round_trip_ns is None else self.round_trip_ns * 1e-6)  # fmt: skip

    def findings(self) -> Iterator[Finding]:
        """One for each kind of trouble, with its count and what it means for the data."""
        c, s = self.counters, self.stats
        told = (
            (c.lost, "samples-lost", f"{c.lost} samples were lost in {c.gaps} gaps", Effect.NOTE),
            (c.late, "samples-late", f"{c.late} samples came after their successors and stay lost", Effect.NOTE),
            (c.duplicates, "frames-duplicated", f"{c.duplicates} samples came twice; one of each was kept", Effect.NOTE),
            (c.reordered, "frames-reordered", f"{c.reordered} samples came out of order and were put back", Effect.NOTE),
            (c.misplaced, "messages-misplaced", f"{c.misplaced} telemetry messages came too late or too early to tell "
             "their samples and were left out. Does the controller send those of a sample together?", Effect.NOTE),
            (c.sequence_leaps, "sequence-leapt", f"the sequence of the telemetry leapt {c.sequence_leaps} times while its tick "
             "went on; no sample is missing by the tick", Effect.NOTE),
            (c.tick_leaps, "tick-leapt", f"the controller's tick leapt {c.tick_leaps} times while its sequence went on: times "
             "within those steps are wrong. Does the tick count by itself?", Effect.INDETERMINATE),
            (self.wrong_length, "wrong-length", f"{self.wrong_length} frames do not have the length of the DBC; they were "
             "left out. Does the firmware's message map match the rig file's?", Effect.INDETERMINATE),
            (c.unknown, "unknown-frames", f"{c.unknown} frames have identifiers that the DBC does not know", Effect.NOTE),
            (c.reboots, "controller-restarted", f"the controller restarted {c.reboots} times", Effect.ERROR),
            (self.repeats, "requests-repeated", f"{self.repeats} requests were sent again because no reply had come; the "
             "controller executes each once", Effect.NOTE),
            (s.crc_errors, "packets-corrupt", f"{s.crc_errors} packets failed their CRC and were dropped", Effect.NOTE),
            (s.malformed, "bytes-malformed", f"{s.malformed} pieces of the byte stream could not be taken apart",
             Effect.NOTE),
            (s.packets_lost, "packets-lost", f"{s.packets_lost} packets are missing by their own numbers", Effect.NOTE),
            (s.error_frames, "error-frames", f"the interface reported {s.error_frames} destroyed frames", Effect.NOTE),
            (s.refused, "frames-refused", f"the interface refused {s.refused} frames or commands", Effect.NOTE),
            (s.adapter_overruns, "adapter-overrun", f"the adapter told {s.adapter_overruns} times of frames that it lost",
             Effect.NOTE),
            (s.overflows, "buffer-overflow", f"{s.overflows} frames were dropped: the bench did not keep up",
             Effect.ERROR),
            (s.bus_off, "bus-off", f"the bus went off {s.bus_off} times", Effect.ERROR),
            (s.reconnects, "link-reconnected", f"the link was lost and came back {s.reconnects} times",
             Effect.INDETERMINATE),
        )  # fmt: skip
        yield from (Finding(code, text, "link", effect) for count, code, text, effect in told if count)
        yield from self._heartbeats()
        for channel in sorted(self.stuck):
            text = f"{channel} read the same for {STILL_S:g} s or more while the rotor was held and the tick went on"
            yield Finding("stuck-channel", f"{text}; a live sensor has noise.", channel, Effect.ERROR)
        yield from self._clock()
        if (self.round_trip_ns or 0) > LATE_S * 1e9:
            yield Finding("link-slow", f"answers take at least {(self.round_trip_ns or 0) * 1e-6:.0f} ms: telemetry may "
                          "be that much older than it looks", "link")  # fmt: skip
        for name, other in self.others.items():
            if other.reconnects:
                text = f"link {name} was lost and came back {other.reconnects} times"
                yield Finding("link-reconnected", text, name)
        if self.latest_ns > LATE_S * 1e9:
            text = f"telemetry came up to {self.latest_ns * 1e-9:.2f} s late; samples carry the device's own time"
            yield Finding("telemetry-late", text, "link")
        if self.cut_ns > 0:
            yield Finding("step-cut", f"a step ended {self.cut_ns * 1e-9:.2f} s before its telemetry had come: what was "
                          "commanded next may act within it", "link", Effect.INDETERMINATE)  # fmt: skip

    def _heartbeats(self) -> Iterator[Finding]:
        """Those that left late are this host's doing; those that left in time and were heard late that of what lies between."""
        sent, heard = self.stats.longest_heartbeat_gap_ns * 1e-9, self.host_age_s
        if max(sent, heard) <= PERIODS * PERIOD_S:
            return
        both = (
            f"{sent * 1e3:.0f} ms was the longest time between two sent, {heard * 1e3:.0f} ms the oldest that the controller "
            "had to go by; its watchdog ends a run at 80 ms by default"
        )
        link = "Look at the link, its adapter or server, and how often the controller reads what came"
        if sent <= PERIODS * PERIOD_S:
            text = f"heartbeats were sent in time and heard late: {both}. {link}"
        elif heard <= sent + PERIODS * PERIOD_S:
            text = f"heartbeats were sent late by this host: {both}. Was the host busy?"
        else:
            text = f"heartbeats were sent late by this host, and heard later still: {both}. Was the host busy? {link}"
        yield Finding("heartbeat-late", text, "link")

    def _clock(self) -> Iterator[Finding]:
        """Host times follow the samples up to 200 ppm, and whatever they gain; beyond that steps and events slide along the
        samples. A clock that gains may be fast, which no simulated one is: that catches up with its computer's load."""
        d, text, check = self.drift, "", CHECK_SERVED if self.simulated else CHECK
        if d is not None and abs(d.ppm) - d.expanded_ppm > DRIFT_PPM:
            effect = Effect.ERROR if abs(d.ppm) - d.expanded_ppm > WRONG_PPM else Effect.INDETERMINATE
            yield Finding("clock-drift", f"{described(d.ppm)} (U = {d.expanded_ppm:.1f} ppm); up to {DRIFT_PPM:.0f} ppm is "
                          f"right. {check}", "link", effect)  # fmt: skip
        elif d is None and self.beyond_drift >= BEYOND:
            text = f"telemetry fell behind the host's clock by more than {DRIFT_PPM:.0f} ppm for {self.beyond_drift} s"
        elif self.unknown_s > UNKNOWN_S and self.gained_ns > GAINED_S * 1e9 and not self.simulated:
            text = f"telemetry gained {self.gained_ns * 1e-6:.0f} ms on the host's clock in the last five seconds"
        elif self.unknown_s > UNKNOWN_S:
            yield Finding("clock-unknown", f"telemetry of {self.unknown_s:.0f} s came so unevenly that the rate of the "
                          "controller's clock cannot be told; times and rates rest on its tick alone", "link")  # fmt: skip
        if text:
            yield Finding("clock-drift", f"{text}. {check}", "link", Effect.INDETERMINATE)
