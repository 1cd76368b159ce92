"""The grammar of injected faults, and what each kind does to a stream of frames."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.errors import ConfigError
from bench.findings import Effect
from bench.link import LinkStats, fault_injection
from bench.link.fault_injection import DEVICE_ONLY, KINDS, SHARES, TIMES, Fault
from bench.link.frame_faults import FrameFaults, corrupt_bytes
from bench.link.frames import ERROR, FRAME, FrameBatch

MS = 1_000_000
T0 = 1_000_000_000_000
TELEMETRY, REPLY = 0x100, 0x021


def frames(count: int, first: int = 0, identifier: int = TELEMETRY) -> FrameBatch:
    """One frame a millisecond, numbered in its data; number 0 at T0."""
    batch = np.zeros(count, FRAME)
    number = np.arange(first, first + count, dtype="<u4")
    batch["t_ns"] = T0 + number.astype(np.int64) * MS
    batch["id"], batch["length"] = identifier, 8
    batch["data"][:, :4] = number.view(np.uint8).reshape(-1, 4)
    return batch


def numbers(batch: FrameBatch) -> list[int]:
    return [int(n) for n in np.ascontiguousarray(batch["data"][:, :4]).view("<u4")[:, 0]]


def through(text: str, batch: FrameBatch, now_ns: int | None = None, seed: int = 1) -> FrameBatch:
    """What is left of a batch, with the fault's times counted from T0."""
    at_work = FrameFaults([fault_injection.parse(text)], seed, telemetry=[TELEMETRY])
    at_work.start(T0)
    return at_work.apply(batch, int(batch["t_ns"][-1]) + MS if now_ns is None else now_ns)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("drop=0.01", Fault("drop", 0.01)),
        ("drop=1@20+5", Fault("drop", 1.0, 20.0, 5.0)),
        ("corrupt=1e-3@.5", Fault("corrupt", 1e-3, 0.5)),
        ("burst=0.2@3+1.5", Fault("burst", 0.2, 3.0, 1.5)),
        (" stall@2+0.5 ", Fault("stall", 0.0, 2.0, 0.5)),
        ("bus-off", Fault("bus-off")),
        ("reboot@10", Fault("reboot", 0.0, 10.0)),
    ],
)
def test_a_fault_is_read(text: str, fault: Fault) -> None:
    assert fault_injection.parse(text) == fault
    assert fault_injection.parse(str(fault)) == fault


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("dorp=0.1", "did you mean 'drop'"),
        ("", "expected one of drop, "),
        ("explode@3", "expected one of drop, "),
        ("drop", "found no value; expected a share above 0 and at most 1: drop=0.01@20+0.5"),
        ("drop=0", "found 0; expected a share"),
        ("drop=1.5", "found 1.5; expected a share"),
        ("drop=10%", "expected KIND[=VALUE][@START[+DURATION]], such as drop=0.01@20+0.5"),
        ("drop=-0.1", "expected KIND[=VALUE]"),
        ("drop=nan", "expected KIND[=VALUE]"),
        ("delay=0", "expected seconds above 0: delay=0.2@20+0.5"),
        ("delay=4000", "expected seconds above 0"),
        ("stall=1", "found a value; stall has none: stall@20+0.5"),
        ("stall@3+0", "found a duration of 0"),
        ("stall+3", "did you mean 'stall'"),
        ("stall@3+", "such as stall@20+0.5"),
    ],
)
def test_what_is_no_fault_is_refused_with_what_is_expected(text: str, said: str) -> None:
    with pytest.raises(ConfigError) as refused:
        fault_injection.parse(text)
    assert f"--fault {text}: " in str(refused.value)
    assert said in str(refused.value)


@given(st.text(st.sampled_from("dropstalmuteby-=@+.0123456789e "), max_size=20))
def test_any_text_is_a_fault_or_refused(text: str) -> None:
    try:
        fault = fault_injection.parse(text)
    except ConfigError:
        return
    assert fault.kind in KINDS
    assert (fault.value > 0) == (fault.kind in (*SHARES, *TIMES))
    assert fault_injection.parse(str(fault)).kind == fault.kind


def test_faults_are_divided_between_link_and_simulated_controller() -> None:
    given_ = [fault_injection.parse(t) for t in ("drop=0.1", "mute", "reboot", "stall")]
    kinds = [[f.kind for f in part] for part in fault_injection.divided(given_, simulated=True)]
    assert kinds == [["drop", "stall"], ["mute", "reboot"]]


def test_a_real_controller_can_be_made_mute_by_its_link_but_not_rebooted() -> None:
    assert fault_injection.divided([fault_injection.parse("mute")], simulated=False) == ([Fault("mute")], [])
    with pytest.raises(ConfigError, match="reboot@3: happens inside the controller, which is not simulated"):
        fault_injection.divided([fault_injection.parse("reboot@3")], simulated=False)


def test_the_record_says_that_the_trouble_was_made() -> None:
    said = fault_injection.announced([fault_injection.parse("drop=0.01@2"), fault_injection.parse("stall")])
    assert (said.code, said.effect) == ("faults-injected", Effect.NOTE)
    assert "drop=0.01@2, stall@0" in said.text


def test_nothing_happens_before_the_host_has_spoken() -> None:
    batch = frames(100)
    at_work = FrameFaults([Fault("drop", 1.0)], 1)
    assert at_work.apply(batch, T0) is batch
    assert not at_work.begun("drop", T0)
    at_work.start(T0 + 50 * MS)
    at_work.start(T0 + 90 * MS)  # only the first counts
    assert numbers(at_work.apply(batch, T0 + 100 * MS)) == list(range(50))


@pytest.mark.parametrize("text", ["drop=1@0.1+0.2", "disconnect@0.1+0.2", "bus-off@0.1+0.2"])
def test_frames_are_lost_from_the_start_to_the_end_of_the_window(text: str) -> None:
    assert numbers(through(text, frames(500))) == [*range(100), *range(300, 500)]


def test_a_share_of_the_frames_is_dropped() -> None:
    left = numbers(through("drop=0.1@1", frames(5000)))
    assert left[:1000] == list(range(1000))
    assert 3500 < len(left) - 1000 < 3700


def test_duplicates_follow_their_originals() -> None:
    got = numbers(through("duplicate=0.1", frames(1000)))
    assert sorted(got) == got
    assert set(got) == set(range(1000))
    assert 1060 < len(got) < 1140


def test_a_reordered_frame_comes_after_its_neighbour_and_none_is_lost() -> None:
    batch = through("reorder=0.1", frames(1000))
    got = np.array(numbers(batch))
    assert sorted(got) == list(range(len(got)))
    swapped = np.flatnonzero(np.diff(got) < 0)
    assert 60 < len(swapped) < 130
    assert np.abs(got - np.arange(len(got))).max() == 1
    assert (np.diff(batch["t_ns"]) >= 0).all()


def test_all_frames_reordered_are_all_pairs_swapped() -> None:
    assert numbers(through("reorder=1", frames(7))) == [1, 0, 3, 2, 5, 4]  # the seventh waits for its neighbour


def test_a_destroyed_frame_is_an_error_frame_and_nothing_of_it_is_left() -> None:
    batch = frames(1000)
    got = through("corrupt=0.1", batch)
    hit = got["flags"] & ERROR != 0
    assert 60 < hit.sum() < 140
    assert not got["data"][hit].any()
    assert not got["length"][hit].any()
    assert (got["t_ns"] == batch["t_ns"]).all()
    assert not (batch["flags"] & ERROR).any()  # the caller's own stays as it was


def test_delayed_frames_come_later_with_the_time_at_which_they_come() -> None:
    at_work = FrameFaults([fault_injection.parse("delay=0.05@0.1+0.1")], 1)
    at_work.start(T0)
    first = at_work.apply(frames(200), T0 + 200 * MS)
    assert numbers(first) == list(range(151))  # number 150 was due at 0.2 s
    assert (first["t_ns"][100:] == T0 + np.arange(150, 201) * MS).all()
    rest = at_work.apply(frames(200, 200), T0 + 400 * MS)
    assert numbers(rest) == list(range(151, 400))
    assert (np.diff(rest["t_ns"]) >= 0).all()  # none overtakes another
    assert (rest["t_ns"][49:99] == T0 + 249 * MS).all()


def test_bursts_come_all_at_once_again_and_again() -> None:
    got = through("burst=0.05@0.1+0.12", frames(400))
    assert numbers(got) == list(range(400))
    times, counts = np.unique(got["t_ns"][100:222], return_counts=True)
    assert ((times - T0) // MS).tolist() == [150, 200, 220, 221]
    assert counts.tolist() == [50, 50, 21, 1]


def test_a_stall_lets_everything_through_in_the_end() -> None:
    at_work = FrameFaults([fault_injection.parse("stall@0.1+0.2")], 1)
    at_work.start(T0)
    assert numbers(at_work.apply(frames(250), T0 + 250 * MS)) == list(range(100))
    assert at_work.active("stall", T0 + 299 * MS)
    assert not at_work.active("stall", T0 + 300 * MS)
    freed = at_work.apply(frames(10, 250), T0 + 300 * MS)
    assert numbers(freed) == list(range(100, 260))
    assert set(freed["t_ns"].tolist()) == {T0 + 300 * MS}


def test_a_stall_without_end_keeps_nothing() -> None:
    at_work = FrameFaults([fault_injection.parse("stall")], 1)
    at_work.start(T0)
    assert len(at_work.apply(frames(1000), T0 + 1000 * MS)) == 0
    assert len(at_work._stages[0].held) == 0


def test_mute_lets_telemetry_pass_and_no_reply() -> None:
    mixed = np.concatenate([frames(10), frames(10, 10, REPLY), frames(10, 20)])
    assert numbers(through("mute", mixed)) == [*range(10), *range(20, 30)]


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.integers(0, 60), max_size=12),
    st.sampled_from(["drop=0.3", "duplicate=0.3", "reorder=0.3", "corrupt=0.3", "delay=0.02@0.05", "burst=0.03"]),
    st.integers(0, 5),
)
def test_cutting_into_batches_changes_nothing(sizes: list[int], text: str, seed: int) -> None:
    batch = frames(400)
    end = T0 + 1000 * MS
    at_work = FrameFaults([fault_injection.parse(text)], seed)
    at_work.start(T0)
    bounds = [0, *np.minimum(np.cumsum(sizes, dtype=int), 400).tolist(), 400]
    parts = []
    for a, b in itertools.pairwise(bounds):
        now = int(batch["t_ns"][b - 1]) if b > a else int(batch["t_ns"][max(a - 1, 0)])
        parts.append(at_work.apply(batch[a:b], now))
    parts.append(at_work.apply(batch[:0], end))
    assert np.concatenate(parts).tobytes() == through(text, batch, end, seed).tobytes()


def test_another_seed_hits_other_frames() -> None:
    assert numbers(through("drop=0.5", frames(100))) == numbers(through("drop=0.5", frames(100)))
    assert numbers(through("drop=0.5", frames(100))) != numbers(through("drop=0.5", frames(100), seed=2))


def test_each_fault_hits_frames_of_its_own() -> None:
    at_work = FrameFaults([Fault("corrupt", 0.5), Fault("duplicate", 0.5)], 1)
    at_work.start(T0)
    got = at_work.apply(frames(2000), T0)
    assert 2900 < len(got) < 3100
    assert 0.45 < (got["flags"] & ERROR != 0).mean() < 0.55  # and not two thirds: the destroyed ones alone come twice


def test_a_cut_is_told_between_what_came_before_and_after_it() -> None:
    at_work = FrameFaults([fault_injection.parse("disconnect@0.1+0.05")], 1)
    at_work.start(T0)
    now = T0 + 300 * MS
    seen = at_work.apply(frames(300), now)
    first, later, cut = at_work.up_to_cut(seen, now, 0.0)
    assert (numbers(first), cut) == (list(range(100)), None)
    nothing, later, cut = at_work.up_to_cut(later, now, 0.0)
    assert (len(nothing), str(cut)) == (0, "disconnect@0.1+0.05")
    after, later, cut = at_work.up_to_cut(later, now, 0.0)
    assert (numbers(after), len(later), cut) == (list(range(150, 300)), 0, None)


def test_a_cut_is_told_as_long_as_it_lasts() -> None:
    at_work = FrameFaults([fault_injection.parse("bus-off@0.1+0.05")], 1)
    at_work.start(T0)
    told = [at_work.up_to_cut(frames(0), T0 + t * MS, 0.0)[2] is not None for t in (99, 100, 149, 150)]
    assert told == [False, True, True, False]
    assert at_work.cut(T0 + 149 * MS) == Fault("bus-off", 0.0, 0.1, 0.05)
    assert at_work.cut(T0 + 150 * MS) is None


@pytest.mark.parametrize(("reconnect_s", "told"), [(0.0, True), (0.04, True), (0.05, False), (1.0, False)])
def test_a_link_that_reconnects_in_time_is_not_told(reconnect_s: float, told: bool) -> None:
    at_work = FrameFaults([fault_injection.parse("disconnect@0.1+0.05")], 1)
    at_work.start(T0)
    assert (at_work.up_to_cut(frames(0), T0 + 120 * MS, reconnect_s)[2] is not None) is told
    counted = at_work.counted(LinkStats(reconnects=2, bus_off=1), T0 + 150 * MS)
    assert (counted.reconnects, counted.bus_off) == (3, 1)


PACKETS = b"".join(bytes([n % 255 + 1]) * 9 + b"\x00" for n in range(2000))


def test_bytes_of_a_share_of_the_packets_are_flipped() -> None:
    at_work = FrameFaults([fault_injection.parse("corrupt=0.1@0.1+0.1")], 1, bytewise=True)
    at_work.start(T0)
    assert at_work.corrupt_packets(PACKETS, T0 + 99 * MS) == PACKETS
    assert at_work.corrupt_packets(PACKETS, T0 + 200 * MS) == PACKETS
    got = np.frombuffer(at_work.corrupt_packets(PACKETS, T0 + 100 * MS), np.uint8).reshape(-1, 10)
    flipped = np.unpackbits(got ^ np.frombuffer(PACKETS, np.uint8).reshape(-1, 10), axis=1).sum(axis=1)
    assert set(flipped.tolist()) == {0, 1, 2, 3}
    assert 150 < (flipped > 0).sum() < 250
    assert numbers(at_work.apply(frames(300), T0 + 300 * MS)) == list(range(300))  # frames are left alone


@given(st.binary(max_size=200), st.integers(0, 5))
def test_any_bytes_keep_their_length(data: bytes, seed: int) -> None:
    assert len(corrupt_bytes(data, 1.0, np.random.default_rng(seed))) == len(data)
    assert corrupt_bytes(data, 0.0, np.random.default_rng(seed)) == data


def test_every_kind_is_one_of_a_group() -> None:
    assert {*SHARES, *TIMES, "stall", *fault_injection.CUTS, "mute", *DEVICE_ONLY} == set(KINDS)
