"""From telemetry frames to blocks: order, losses, duplicates, wrap-around and reboot, counted exactly."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from bench.errors import InterlockError
from bench.link.codec import encode
from bench.link.frames import FrameBatch, empty_batch, frame
from bench.link.telemetry import TelemetryDecoder
from bench.rigfile import load_rig
from bench.rigfile.envelope import Envelope
from bench.samples import SampleBlock

RIG = load_rig("tsbs12")
MESSAGE = RIG.messages["Telemetry"]
T0 = 10_000_000_000_000


def one(sequence: int, tick: int | None = None, **values: float) -> FrameBatch:
    tick = sequence * 10 if tick is None else tick
    payload = encode(MESSAGE, {"seq": sequence & 0xFFFF, "tick": tick & 0xFFFFFFFF, "temp_i": 295, "temp_o": 295,
                               "temp_m": 295, "supply": 148, **values})  # fmt: skip
    return frame(MESSAGE.identifier, payload, t_ns=T0 + sequence * 1_000_000)


def batch(*sequences: int) -> FrameBatch:
    return np.concatenate([empty_batch(), *(one(s) for s in sequences)])


def test_a_gap_starts_a_block_that_says_how_many_are_missing() -> None:
    decoder = TelemetryDecoder(RIG)
    blocks = decoder.decode(batch(1, 2, 3, 7, 8))
    assert [(b.first_index, len(b), b.lost_before) for b in blocks] == [(0, 3, 0), (6, 2, 3)]
    (later,) = decoder.decode(batch(10))
    assert (later.first_index, later.lost_before) == (9, 1)
    assert (decoder.counters.lost, decoder.counters.gaps) == (4, 2)
    assert later.t_ns[0] - blocks[0].t_ns[0] == 9_000_000


def test_duplicates_and_reordering_are_put_right_and_counted() -> None:
    decoder = TelemetryDecoder(RIG)
    (block,) = decoder.decode(batch(1, 3, 2, 2, 4))
    assert block.ticks.tolist() == [10, 20, 30, 40]
    assert (decoder.counters.duplicates, decoder.counters.reordered, decoder.counters.lost) == (1, 1, 0)


def test_counters_wrap() -> None:
    decoder = TelemetryDecoder(RIG)
    near = (1 << 32) - 20
    frames = [one(65534 + k, near + 10 * k) for k in range(4)]
    (block,) = decoder.decode(np.concatenate(frames))
    assert np.diff(block.ticks.astype(np.int64)).tolist() == [10, 10, 10]
    assert decoder.counters.lost == 0


def test_a_reboot_starts_over() -> None:
    decoder = TelemetryDecoder(RIG)
    decoder.decode(np.concatenate([one(5000 + k, 500_000 + 10 * k) for k in range(3)]))
    blocks = decoder.decode(np.concatenate([one(6000 + k, 10 * k + 10) for k in range(3)]))
    assert decoder.counters.reboots == 1
    assert sum(len(b) for b in blocks) == 3


@pytest.mark.parametrize("gap", [0, 1, 100, 30_000, 32_767, 40_000, 65_535, 65_536, 70_000, 200_000])
@pytest.mark.parametrize("stretch", [1.0, 0.985, 1.015])
def test_a_gap_of_any_length_is_counted_by_the_tick(gap: int, stretch: float) -> None:
    """Longer than the sequence goes, or half of it; the tick need not have quite the length that the rig file says."""
    decoder = TelemetryDecoder(RIG)
    numbers = [*range(5000, 5100), *(5100 + gap + k for k in range(300))]
    frames = [one(n, round(n * 10 * stretch)) for n in numbers]
    blocks = [b for k in range(0, 400, 50) for b in decoder.decode(np.concatenate(frames[k : k + 50]))]
    assert sum(len(b) for b in blocks) == 400
    assert counted(decoder) == ({"lost": gap, "gaps": 1} if gap else {})
    assert blocks[-1].first_index + len(blocks[-1]) == 400 + gap
    assert blocks[-1].ticks[-1] == round(numbers[-1] * 10 * stretch)


def counted(decoder: TelemetryDecoder) -> dict[str, int]:
    return {name: n for name, n in vars(decoder.counters).items() if n}


MISMATCHES: dict[str, Callable[[int], tuple[int, int]]] = {
    "tick stands": lambda k: (k, 0),
    "tick of double length": lambda k: (k, 5 * k),
    "tick of half length": lambda k: (k, 20 * k),
    "tick jumps on by 40 s": lambda k: (k, 10 * k + (400_000 if k >= 150 else 0)),
    "tick jumps back by half a second": lambda k: (k + 1000, 10 * k + 10_000 - (5_000 if k >= 150 else 0)),
    "sequence begins anew": lambda k: (k if k >= 150 else k + 5_000, 10 * k),
    "sequence begins anew near its end": lambda k: (k if k >= 150 else k + 60_000, 10 * k),
}


@pytest.mark.parametrize("size", [1, 20, 300])
@pytest.mark.parametrize("kind", list(MISMATCHES))
def test_sequence_and_tick_that_do_not_fit_count_nothing_that_is_not_missing(kind: str, size: int) -> None:
    decoder = TelemetryDecoder(RIG)
    frames = [one(*MISMATCHES[kind](k)) for k in range(300)]
    blocks = [b for k in range(0, 300, size) for b in decoder.decode(np.concatenate(frames[k : k + size]))]
    leap = "sequence_leaps" if "sequence" in kind else "tick_leaps"
    assert counted(decoder) == ({leap: 1} if "jumps" in kind or "anew" in kind else {})
    assert sum(len(b) for b in blocks) == 300


@pytest.mark.parametrize("size", [1, 7, 300])
@pytest.mark.parametrize("leap", [3, 5000, 40_000, -5])
def test_a_leap_of_the_sequence_is_no_loss(leap: int, size: int) -> None:
    decoder = TelemetryDecoder(RIG)
    frames = [one(1000 + k + (leap if k >= 150 else 0), 10 * k) for k in range(300)]
    blocks = [b for k in range(0, 300, size) for b in decoder.decode(np.concatenate(frames[k : k + size]))]
    assert counted(decoder) == {"sequence_leaps": 1}
    assert blocks[-1].first_index + len(blocks[-1]) == sum(len(b) for b in blocks) == 300
    assert blocks[-1].t_ns[-1] - blocks[0].t_ns[0] == 299 * 1_000_000


@pytest.mark.parametrize("size", [1, 7, 300])
def test_a_leap_of_the_tick_by_three_samples_is_counted(size: int) -> None:
    decoder = TelemetryDecoder(RIG)
    frames = [one(k, 10 * k + (30 if k >= 150 else 0)) for k in range(300)]
    blocks = [b for k in range(0, 300, size) for b in decoder.decode(np.concatenate(frames[k : k + size]))]
    assert counted(decoder) == {"tick_leaps": 1}
    assert sum(len(b) for b in blocks) == 300


def test_a_loss_beside_a_leap_of_the_sequence_is_still_counted() -> None:
    decoder = TelemetryDecoder(RIG)
    numbers = [k for k in range(300) if not 100 <= k < 110]
    decoder.decode(np.concatenate([one(k + (5000 if k >= 150 else 0), 10 * k) for k in numbers]))
    assert counted(decoder) == {"lost": 10, "gaps": 1, "sequence_leaps": 1}


def test_a_tick_of_few_bits_does_not_make_a_restart_of_a_gap() -> None:
    """16 bits of 100 us come round in 6.6 s; after 5 s the short way round is 1.6 s back."""
    decoder = TelemetryDecoder(RIG)
    decoder._assembler.tick_bits = 16
    first = np.concatenate([one(n, n * 10 & 0xFFFF) for n in range(100)])
    again = np.concatenate([one(n, n * 10 & 0xFFFF) for n in range(5100, 5200)])
    blocks = [*decoder.decode(first), *decoder.decode(again)]
    assert counted(decoder) == {"lost": 5000, "gaps": 1}
    assert blocks[-1].t_ns[-1] - blocks[0].t_ns[0] == 5199 * 1_000_000
    decoder.decode(np.concatenate([one(n, n * 10) for n in range(10)]))
    assert decoder.counters.reboots == 1


def test_wrong_lengths_are_counted_and_never_read() -> None:
    decoder = TelemetryDecoder(RIG)
    short = one(2)
    short["length"] = 20
    (block,) = decoder.decode(np.concatenate([one(1), short, one(3)]))[:1]
    assert decoder.counters.wrong_length == 1
    assert decoder.counters.lost == 1
    assert len(block) == 1


def block(**values: float) -> SampleBlock:
    (made,) = TelemetryDecoder(RIG).decode(one(1, None, **values))
    return made


@pytest.mark.parametrize(
    ("values", "name"),
    [({"speed": 76.0}, "speed"), ({"i_yo_p": 13.0}, "i_yo_p"), ({"temp_m": 360.0}, "temp_m"),
     ({"pos_yi": 1.6e-4, "state": 3}, "pos_yi"), ({"pos_xo": -1.6e-4, "state": 4}, "pos_xo"),
     ({"supply": 100.0, "state": 3}, "supply fell to 100 V"), ({"supply": 170.0, "state": 4}, "supply reached 170 V")],
)  # fmt: skip
def test_the_envelope_trips_and_names_the_channel(values: dict[str, float], name: str) -> None:
    with pytest.raises(InterlockError, match=name):
        Envelope(RIG).check_block(block(**values))


def test_the_envelope_lets_a_resting_rotor_rest() -> None:
    Envelope(RIG).check_block(block(pos_yi=-2.5e-4, state=0, speed=74.9, supply=0))


@pytest.mark.parametrize(
    ("name", "value"), [("bias_i", 5.1), ("bias_i", -0.1), ("nothing", 0.0), ("gamma", float("nan"))]
)
def test_the_envelope_refuses_a_command(name: str, value: float) -> None:
    with pytest.raises(InterlockError, match="nothing was sent"):
        Envelope(RIG).check_parameter(name, value)


@pytest.mark.parametrize("value", [0.0, 5.0, 3.0])
def test_boundaries_belong_to_the_envelope(value: float) -> None:
    Envelope(RIG).check_parameter("bias_i", value)
