"""Samples of several messages: joined by SYNC and counter bits, and never made of parts of different samples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.link.codec import encode
from bench.link.frames import FrameBatch, empty_batch, frame
from bench.link.joining import KEPT, Joiner, Sample
from bench.link.sample_assembler import Assembler, Rows
from bench.link.telemetry import TelemetryDecoder
from bench.rigfile import load_rig

PLAIN = load_rig(str(Path(__file__).resolve().parent.parent / "examples" / "own-controller" / "plainamb.toml"))
MESSAGES = ("AmbSync", "AmbPos", "AmbCurX", "AmbCurY", "AmbRest")
T0 = 1_767_225_600 * 10**9
PERIOD_NS = 1_000_000


def part(name: str, number: int, **values: float) -> FrameBatch:
    m = PLAIN.messages[name]
    counters = {"SeqNo": number & 0xFFFF, "Ticks": 10 * number} if name == "AmbSync" else {"Rolling": number & 0xF}
    return frame(m.identifier, encode(m, {**counters, **values}), t_ns=T0 + number * PERIOD_NS)


def sample(number: int, without: str = "", **values: float) -> list[FrameBatch]:
    known = {m: {s.name for s in PLAIN.messages[m].signals} for m in MESSAGES}
    return [part(m, number, **{k: v for k, v in values.items() if k in known[m]}) for m in MESSAGES if m != without]


def joined(*frames: FrameBatch) -> FrameBatch:
    return np.concatenate([empty_batch(), *frames])


def test_five_messages_make_one_row_in_si_when_the_next_sample_begins() -> None:
    assembler = Assembler(PLAIN)
    values = {"Mode": 3.0, "XA": -12.5, "YB": 409.575, "IXA_pos": -16384.0, "IYB_neg": 2500.0, "RotorAngle": -90.0,
              "RotorSpeed": 600.0, "CoilTemp": 21.5}  # fmt: skip
    assert len(assembler.take(joined(*sample(7, **values)))) == 0
    rows = assembler.take(joined(part("AmbSync", 8)))
    assert (rows.sequence.tolist(), rows.tick.tolist(), rows.arrived.tolist()) == ([7], [70], [T0 + 7 * PERIOD_NS])
    found = {name: float(column[0]) for name, column in rows.columns.items()}
    expected = {"state": 3, "pos_xi": -12.5e-6, "pos_yo": 409.575e-6, "i_xi_p": -16.384, "i_yo_n": 2.5,
                "angle": -np.pi / 2, "speed": 20 * np.pi, "temp_o": 294.65, "i_yi_p": 0.0}  # fmt: skip
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=1e-12), name
    assert set(found) == set(PLAIN.channels)


def test_golden_bytes_of_both_byte_orders() -> None:
    """Worked out by hand: little endian 1 | -2 << 4 (15 bits) ...; big endian 1 << 60 | -2 << 45 ..."""
    little = bytes.fromhex("e1ff070000000000")  # Rolling 1, XA raw -2
    big = bytes.fromhex("1fffc00000000000")  # Rolling 1, IXA_pos raw -2
    assert encode(PLAIN.messages["AmbPos"], {"Rolling": 1, "XA": -0.05}) == little
    assert encode(PLAIN.messages["AmbCurX"], {"Rolling": 1, "IXA_pos": -2}) == big
    assembler = Assembler(PLAIN)
    assembler.take(
        joined(part("AmbSync", 1), frame(144, little), frame(145, big), part("AmbCurY", 1), part("AmbRest", 1))
    )
    rows = assembler.take(part("AmbSync", 2))
    assert rows.columns["pos_xi"].tolist() == pytest.approx([-0.05e-6])
    assert rows.columns["i_xi_p"].tolist() == pytest.approx([-0.002])


@pytest.mark.parametrize("missing", MESSAGES)
def test_a_sample_with_a_part_missing_is_lost_and_shows_as_a_gap(missing: str) -> None:
    decoder = TelemetryDecoder(PLAIN)
    frames = [f for n in range(20) for f in sample(n, missing if n == 9 else "")]
    blocks = decoder.decode(joined(*frames))
    assert [(b.first_index, len(b), b.lost_before) for b in blocks] == [(0, 9, 0), (10, 9, 1)]
    assert vars(decoder.counters) == {**vars(TelemetryDecoder(PLAIN).counters), "gaps": 1, "lost": 1}


def test_any_cut_of_the_stream_gives_the_same_rows() -> None:
    whole = joined(*(f for n in range(65530, 65560) for f in sample(n, XA=float(n % 100))))
    expected = Assembler(PLAIN).take(whole)
    assert expected.sequence.tolist() == [n & 0xFFFF for n in range(65530, 65559)]
    for step in (1, 3, 7, 64):
        assembler = Assembler(PLAIN)
        pieces = [assembler.take(whole[k : k + step]) for k in range(0, len(whole), step)]
        assert np.concatenate([p.sequence for p in pieces]).tolist() == expected.sequence.tolist()
        assert np.concatenate([p.columns["pos_xi"] for p in pieces]).tolist() == expected.columns["pos_xi"].tolist()


def test_frames_of_a_wrong_length_are_counted_and_their_sample_is_lost() -> None:
    assembler = Assembler(PLAIN)
    frames = [f for n in range(6) for f in sample(n)]
    frames[2 * 5 + 3]["length"] = 7
    rows = assembler.take(joined(*frames))
    assert (assembler.wrong_length, rows.sequence.tolist()) == (1, [0, 1, 3, 4])


def test_a_loss_of_sixteen_samples_does_not_join_what_lies_on_both_sides() -> None:
    """Sample 5 lacks its last part; after the loss a part with the same four bits comes, that of sample 21."""
    assembler = Assembler(PLAIN)
    before = [f for n in range(5) for f in sample(n)] + sample(5, without="AmbRest")
    after = [part("AmbRest", 21), *(f for n in range(22, 25) for f in sample(n))]
    rows = assembler.take(joined(*before, *after))
    assert rows.sequence.tolist() == [0, 1, 2, 3, 4, 22, 23]


def test_a_restart_begins_anew() -> None:
    decoder = TelemetryDecoder(PLAIN)
    decoder.decode(joined(*(f for n in range(5000, 5010) for f in sample(n))))
    again = joined(*(f for n in range(10) for f in sample(n)))
    again["t_ns"] += 6000 * PERIOD_NS
    blocks = decoder.decode(again)
    assert sum(len(b) for b in blocks) == 9
    assert decoder.counters.reboots == 1


def test_a_sample_after_an_early_restart_has_no_part_of_the_one_with_its_number_before() -> None:
    joiner = Joiner(16, [4, 4])
    joiner.sync(3, 30, 0, np.array([0.0]))
    joiner.data(1, 3, np.array([1.0]))
    done = [s for n in range(5) for s in restarted(joiner, n)]
    assert [[float(x[0]) for x in s.values if x is not None] for s in done if s.sequence == 3] == []


def restarted(joiner: Joiner, number: int) -> list:  # type: ignore[type-arg]
    """Sample `number` of the new life (ticks differ), whose part 1 is lost."""
    done = joiner.sync(number, number, 0, np.array([10.0]))
    joiner.data(2, number, np.array([12.0]))
    return done


PARTS = 3
GAPS = st.sampled_from([0] * 12 + [1, 2, 10, 11, 12, 13, 14, 15, 16, 17, 31, 32, 48, 100, 256, 1000])


@settings(deadline=None, max_examples=120)
@given(
    start=st.integers(0, 65535),
    bits=st.sampled_from([4, 8]),
    samples=st.lists(st.tuples(GAPS, st.integers(0, 2**PARTS - 1)), min_size=2, max_size=40),
    data=st.data(),
)
def test_no_row_is_made_of_parts_of_different_samples(
    start: int, bits: int, samples: list[tuple[int, int]], data: st.DataObject
) -> None:
    """Parts dropped, doubled, and late by up to two samples, with losses of any length between them."""
    sent = []
    number = start
    for gap, dropped in samples:
        number += 1 + gap
        for k in range(PARTS):
            for copy in range(data.draw(st.sampled_from([1, 1, 1, 1, 2])) if not dropped >> k & 1 else 0):
                late = data.draw(st.integers(0, 2 * PARTS)) if copy or data.draw(st.booleans()) else 0
                sent.append((number * PARTS + k + late, number, k))
    joiner = Joiner(16, [bits] * (PARTS - 1))
    done = []
    for _, n, k in sorted(sent):
        if k:
            joiner.data(k, n % (1 << bits), np.array([float(n)]))
        else:
            done += joiner.sync(n & 0xFFFF, n * 10, n, np.array([float(n)]))
    for s in done:
        assert {float(v[0]) for v in s.values if v is not None} == {float(s.arrived)}
        assert (s.sequence, s.tick) == (s.arrived & 0xFFFF, 10 * s.arrived)


def delayed(bits: int, start: int, lateness: list[int]) -> tuple[Joiner, list[Sample]]:
    """A SYNC for each lateness; part 1 of a sample comes so many samples after its SYNC, part 2 with it."""
    joiner, done = Joiner(16, [bits] * 2), []
    due = sorted((k + late, k) for k, late in enumerate(lateness))
    for n in range(len(lateness)):
        done += joiner.sync((start + n) & 0xFFFF, n * 10, n, np.array([float(n)]))
        joiner.data(2, (start + n) % (1 << bits), np.array([float(n)]))
        for when, k in due:
            if when == n:
                joiner.data(1, (start + k) % (1 << bits), np.array([float(k)]))
    return joiner, done


@pytest.mark.parametrize("bits", [4, 5, 8])
@pytest.mark.parametrize("late", range(15))
def test_messages_that_are_always_late_are_joined_or_left_out_and_counted(bits: int, late: int) -> None:
    joiner, done = delayed(bits, 65_500, [late] * 200)
    assert {float(v[0]) - s.arrived for s in done for v in s.values if v is not None} <= {0.0}
    if late <= KEPT - 1:
        assert (len(done), joiner.misplaced) == (199 - late, 0)
    else:
        assert (len(done), joiner.misplaced) == (0, 199 - late)


@settings(deadline=None, max_examples=60)
@given(
    start=st.integers(0, 65535),
    bits=st.sampled_from([4, 5, 8]),
    runs=st.lists(st.tuples(st.integers(0, 14), st.integers(1, 30)), min_size=1, max_size=12),
)
def test_no_lateness_below_a_round_of_the_count_mixes_samples(
    start: int, bits: int, runs: list[tuple[int, int]]
) -> None:
    _, done = delayed(bits, start, [late for late, n in runs for _ in range(n)])
    for s in done:
        assert {float(v[0]) for v in s.values if v is not None} == {float(s.arrived)}


def test_messages_left_out_reach_the_counters() -> None:
    decoder = TelemetryDecoder(PLAIN)
    frames = [f for n in range(40) for f in (*sample(n, "AmbRest"), *([part("AmbRest", n - 9)] if n >= 9 else []))]
    assert decoder.decode(joined(*frames)) == []
    assert decoder.counters.misplaced == 30


@settings(deadline=None, max_examples=60)
@given(start=st.integers(0, 65535), delays=st.lists(st.integers(0, PARTS), min_size=90, max_size=90))
def test_what_is_only_out_of_order_is_complete(start: int, delays: list[int]) -> None:
    sent = sorted((n * PARTS + k + delays[n * PARTS + k], n, k) for n in range(30) for k in range(PARTS))
    joiner = Joiner(16, [4] * (PARTS - 1))
    found = []
    began = False
    for _, n, k in sent:
        began |= k == 0
        if k:
            joiner.data(k, (start + n) % 16, np.array([float(n)]))
        else:
            found += joiner.sync((start + n) & 0xFFFF, n, n, np.array([float(n)]))
    assert {s.arrived for s in found} >= set(range(3, 27))
    assert len({s.arrived for s in found}) == len(found)


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(st.sampled_from([16, 128, 144, 145, 146, 147]), st.binary(max_size=8)), max_size=60))
def test_arbitrary_bytes_never_crash(frames: list[tuple[int, bytes]]) -> None:
    rows = Assembler(PLAIN).take(joined(*(frame(i, d) for i, d in frames)))
    assert isinstance(rows, Rows)
    assert all(len(column) == len(rows) for column in rows.columns.values())


@settings(deadline=None, max_examples=150)
@given(
    order=st.permutations(MESSAGES),
    start=st.integers(65_500, 65_540),
    steps=st.lists(st.sampled_from([1] * 20 + [2, 17, -30_000]), min_size=2, max_size=30),
    faults=st.lists(st.tuples(st.integers(0, 149), st.sampled_from(["lost", "doubled", "later"])), max_size=3),
    cut=st.integers(1, 150),
)
def test_a_batch_gives_what_its_frames_give_one_by_one(
    order: list[str], start: int, steps: list[int], faults: list[tuple[int, str]], cut: int
) -> None:
    numbers = (start + np.cumsum(steps)).tolist()
    told = {"AmbPos": "XA", "AmbCurX": "IXA_pos", "AmbRest": "RotorSpeed"}
    frames = [part(m, n, **({told[m]: float(n % 64)} if m in told else {})) for n in numbers for m in order]
    for at, kind in (x for x in faults if x[0] < len(frames) - 1):
        frames[at : at + 2] = {"lost": [frames[at + 1]], "doubled": [frames[at], *frames[at : at + 2]],
                               "later": [frames[at + 1], frames[at]]}[kind]  # fmt: skip
    single, several = Assembler(PLAIN), Assembler(PLAIN)
    expected = [single.take(f) for f in frames]
    found = [several.take(joined(*frames[:cut])), several.take(joined(*frames[cut:]))]
    for field in ("sequence", "tick", "arrived"):
        assert np.concatenate([getattr(r, field) for r in found]).tolist() == \
            np.concatenate([getattr(r, field) for r in expected]).tolist()  # fmt: skip
    for name in PLAIN.channels:
        assert np.concatenate([r.columns[name] for r in found]).tolist() == \
            np.concatenate([r.columns[name] for r in expected]).tolist()  # fmt: skip
    assert several.misplaced == single.misplaced
