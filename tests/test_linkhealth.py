"""What a run says about its link: nothing on a clean one, and one finding with its count for each kind of trouble."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import pytest

from bench.findings import Effect
from bench.link import LinkStats
from bench.link.health import BEYOND, Health
from bench.link.hosttime import Drift
from bench.link.telemetry import Counters

CLEAN = LinkStats(received=100_000, sent=5_000, heartbeats=4_000, longest_heartbeat_gap_ns=21_000_000)
TROUBLES = [f.name for f in fields(Counters) if f.name != "gaps"]
TROUBLES += [f.name for f in fields(LinkStats) if f.name not in
             ("received", "sent", "octets", "heartbeats", "longest_heartbeat_gap_ns")]  # fmt: skip
STOPPING = {"wrong_length": Effect.INDETERMINATE, "reboots": Effect.ERROR, "overflows": Effect.ERROR,
            "bus_off": Effect.ERROR, "reconnects": Effect.INDETERMINATE, "tick_leaps": Effect.INDETERMINATE}  # fmt: skip


def test_a_clean_link_has_no_findings() -> None:
    health = Health(Counters(), CLEAN, None, 5_000_000)
    assert list(health.findings()) == []
    counts = health.counts(105_000)
    assert (counts.frames, counts.gaps, counts.errors) == (105_000, 0, 0)
    assert (counts.drift_ppm, counts.drift_expanded_ppm, counts.latest_ms) == (None, None, 5.0)
    assert counts.counts["heartbeats"] == 4_000


@pytest.mark.parametrize("trouble", TROUBLES)
def test_each_trouble_is_counted_and_named(trouble: str) -> None:
    counters, stats = Counters(), LinkStats()
    setattr(counters if hasattr(counters, trouble) else stats, trouble, 37)
    health = Health(counters, stats, None, 0)
    (finding,) = health.findings()
    assert "37" in finding.text
    assert finding.where == "link"
    assert finding.effect is STOPPING.get(trouble, Effect.NOTE)
    counts = health.counts(0)
    assert counts.counts[trouble] == 37
    assert counts.errors == 37


def test_channels_that_stood_are_named_each() -> None:
    found = list(Health(Counters(), CLEAN, None, 0, stuck={"pos_yi", "i_yo_p"}).findings())
    assert [(f.code, f.where, f.effect) for f in found] == [
        ("stuck-channel", "i_yo_p", Effect.ERROR), ("stuck-channel", "pos_yi", Effect.ERROR)]  # fmt: skip


def test_every_finding_has_a_code_of_its_own() -> None:
    counters = Counters(**{f.name: 1 for f in fields(Counters)})
    stats = LinkStats(**{f.name: 10**9 for f in fields(LinkStats)})
    codes = [f.code for f in Health(counters, stats, Drift(1.0, 2.0, 9), 10**9).findings()]
    assert len(set(codes)) == len(codes) == len(TROUBLES) + 2


def test_requests_that_had_to_be_repeated_are_counted_and_named() -> None:
    health = Health(Counters(), CLEAN, None, 0, repeats=2)
    (finding,) = health.findings()
    assert (finding.code, finding.effect) == ("requests-repeated", Effect.NOTE)
    assert "2 requests were sent again" in finding.text
    assert health.counts(0).counts["repeats"] == health.counts(0).errors == 2


@pytest.mark.parametrize(("latest_ns", "count"), [(39_000_000, 0), (41_000_000, 1)])
def test_late_telemetry_is_named(latest_ns: int, count: int) -> None:
    assert [f.code for f in Health(Counters(), CLEAN, None, latest_ns).findings()] == ["telemetry-late"] * count


def test_late_telemetry_alone_is_no_reason_to_doubt_what_was_measured_but_a_step_that_was_left_before_it_came_is() -> (
    None
):
    (late,) = Health(Counters(), CLEAN, None, 9_000_000_000).findings()
    assert late.effect is Effect.NOTE
    (cut,) = Health(Counters(), CLEAN, None, 0, cut_ns=700_000_000).findings()
    assert (cut.code, cut.effect) == ("step-cut", Effect.INDETERMINATE)
    assert "0.70 s" in cut.text


@pytest.mark.parametrize(("gap_ns", "count"), [(59_000_000, 0), (61_000_000, 1)])
def test_a_heartbeat_gap_near_the_watchdog_is_named(gap_ns: int, count: int) -> None:
    heard = Health(Counters(), CLEAN, None, 0, host_age_s=gap_ns * 1e-9)
    assert [f.code for f in heard.findings()] == ["heartbeat-late"] * count
    slow = Health(Counters(), CLEAN, None, 0, round_trip_ns=gap_ns - 20_000_000)
    assert [f.code for f in slow.findings()] == ["link-slow"] * count
    stats = LinkStats(longest_heartbeat_gap_ns=gap_ns)
    assert [f.code for f in Health(Counters(), stats, None, 0).findings()] == ["heartbeat-late"] * count


def test_heartbeats_that_were_sent_late_are_this_hosts_and_those_heard_late_are_not() -> None:
    (sent,) = Health(Counters(), LinkStats(longest_heartbeat_gap_ns=280_000_000), None, 0, host_age_s=0.285).findings()
    assert sent.text.startswith("heartbeats were sent late by this host: ")
    assert "link" not in sent.text
    (both,) = Health(Counters(), LinkStats(longest_heartbeat_gap_ns=65_000_000), None, 0, host_age_s=0.28).findings()
    assert "heard later still" in both.text
    (heard,) = Health(Counters(), CLEAN, None, 0, host_age_s=0.28).findings()
    assert heard.text.startswith("heartbeats were sent in time and heard late")
    assert "busy" not in heard.text
    for text, *figures in ((sent.text, "280 ms", "285 ms"), (heard.text, "21 ms", "280 ms")):
        assert all(figure in text for figure in figures)


@pytest.mark.parametrize(
    ("ppm", "expanded", "effect"),
    [(190.0, 1.0, None), (260.0, 70.0, None), (260.0, 50.0, Effect.INDETERMINATE), (-260.0, 50.0, Effect.INDETERMINATE),
     (1040.0, 50.0, Effect.INDETERMINATE), (1060.0, 50.0, Effect.ERROR), (-3009.0, 0.1, Effect.ERROR)],
)  # fmt: skip
def test_a_clock_that_no_crystal_has_is_judged(ppm: float, expanded: float, effect: Effect | None) -> None:
    found = list(Health(Counters(), CLEAN, Drift(ppm, expanded, 60), 0).findings())
    assert [(f.code, f.effect) for f in found] == ([("clock-drift", effect)] if effect else [])
    for f in found:
        assert f"{abs(ppm):.0f} ppm {'slow' if ppm > 0 else 'fast'}" in f.text
        assert "tick_s in the rig file" in f.text


def test_a_clock_is_judged_before_its_drift_is_known() -> None:
    def effects(windows: int, drift: Drift | None = None) -> list[tuple[str, Effect]]:
        health = Health(Counters(), CLEAN, drift, 0, beyond_drift=windows)
        return [(f.code, f.effect) for f in health.findings()]

    assert effects(BEYOND - 1) == []
    assert effects(BEYOND) == [("clock-drift", Effect.INDETERMINATE)]
    assert effects(BEYOND, Drift(3.0, 5.0, 9)) == []  # it is latency


def test_a_rate_that_nothing_tells_is_said() -> None:
    def told(unknown_s: float, gained_ns: int = 0, windows: int = 0) -> list[tuple[str, Effect]]:
        health = Health(Counters(), CLEAN, None, 0, beyond_drift=windows, unknown_s=unknown_s, gained_ns=gained_ns)
        return [(f.code, f.effect) for f in health.findings()]

    assert told(5.5, 10**9) == []
    assert told(6.5) == told(6.5, 19_000_000) == [("clock-unknown", Effect.NOTE)]
    assert told(6.5, 21_000_000) == told(6.5, 0, BEYOND) == [("clock-drift", Effect.INDETERMINATE)]


def test_a_simulated_controller_that_catches_up_has_no_wrong_clock() -> None:
    """Its ticks are right by definition; what falls behind slides steps along samples, and is its computer's doing."""

    def told(**of: Any) -> list[tuple[str, Effect, str]]:
        found = Health(Counters(), CLEAN, of.pop("drift", None), 0, simulated=True, **of).findings()
        return [(f.code, f.effect, f.text) for f in found]

    ((code, effect, _),) = told(unknown_s=13.0, gained_ns=335_000_000)
    assert (code, effect) == ("clock-unknown", Effect.NOTE)
    for of in ({"unknown_s": 13.0, "beyond_drift": BEYOND}, {"drift": Drift(260.0, 50.0, 60)}):
        ((code, effect, text),) = told(**of)
        assert (code, effect) == ("clock-drift", Effect.INDETERMINATE)
        assert "computer that serves it does not keep up" in text
        assert "crystal" not in text


@pytest.mark.parametrize(("ppm", "rate"), [(1e6, "0.500"), (-5e5, "2.000"), (-19_608.0, "1.020")])
def test_a_gross_error_is_told_as_a_factor(ppm: float, rate: str) -> None:
    (found,) = Health(Counters(), CLEAN, Drift(ppm, 5.0, 60), 0).findings()
    assert (found.code, found.effect) == ("clock-drift", Effect.ERROR)
    assert found.text.startswith(f"the controller's clock runs at {rate} of the rate that the rig file states")


def test_replies_of_a_wrong_length_count_with_the_telemetry_of_one() -> None:
    health = Health(Counters(wrong_length=2), CLEAN, None, 0, replies_wrong_length=3)
    (finding,) = health.findings()
    assert (finding.code, finding.effect) == ("wrong-length", Effect.INDETERMINATE)
    assert finding.text.startswith("5 frames")
    assert (health.counts(0).errors, health.counts(0).counts["wrong_length"]) == (5, 5)


def test_drift_is_in_the_counts() -> None:
    counts = Health(Counters(), CLEAN, Drift(12.5, 3.0, 60), 0).counts(1)
    assert (counts.drift_ppm, counts.drift_expanded_ppm) == (12.5, 3.0)
