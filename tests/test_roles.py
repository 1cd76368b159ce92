"""What procedures ask for by what it is: readings of the mark and the status word, whatever channels and bits a rig has."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from test_machine_tables import RIGS
from test_rigfile import changed

from bench.errors import Lacking
from bench.procedure.requires import Requires
from bench.rigfile import RigFile, load_rig
from bench.rigfile.roles import (
    AGE,
    ANGLE,
    EDGE,
    SPEED,
    STATUS,
    Status,
    answered,
    bits,
    edge_round_s,
    exact,
    read_now,
    resolved,
    untold,
    whole_channels,
)
from bench.samples import TICKS

ROOT = Path(__file__).resolve().parent.parent
SPINDLE = str(ROOT / "examples/vertical-spindle/spindle.toml")


def rig(*changes: tuple[str, str], name: str = "amb5dof") -> RigFile:
    toml, dbc = RIGS[name]
    return RigFile.parse(changed(toml, *changes), dbc)


def test_a_role_is_read_from_the_channel_that_the_rig_binds() -> None:
    renamed = rig(('angle = "angle"', 'angle = "gamma"'), ("\nangle = { signal", "\ngamma = { signal"))
    assert resolved(renamed, (ANGLE, "pos_yi", SPEED)) == ("gamma", "pos_yi", "speed")
    samples = {"gamma": np.array([1.0, 2.0]), "pos_yi": np.array([3.0, 4.0]), "t_ns": np.array([0, 1])}
    told = answered(renamed, (ANGLE, "pos_yi"), samples)
    assert told.keys() == {ANGLE, "pos_yi", "t_ns"}
    assert told[ANGLE] is samples["gamma"]


def test_a_role_that_is_not_bound_is_lacking() -> None:
    with pytest.raises(Lacking, match="mark: found no channel for edge"):
        resolved(rig(), (EDGE,))
    assert Requires(channels=(EDGE, "pos_yi")).lacking(rig())[0] == "mark: found no channel for edge"


def test_the_status_word_is_made_of_the_bits_of_any_channels() -> None:
    """A mask of bits, a channel of its own that is not zero; ranges of the shipped rigs' own words by hand."""
    word = np.array([0.0, 1.0, 4.0, 2 + 8, 32 + 64, 16])
    said = answered(rig(), (STATUS,), {"flags": word})[STATUS]
    near, far, axial = Status.CONTACT_NEAR, Status.CONTACT_FAR, Status.CONTACT_AXIAL
    assert said.tolist() == [0, 1, near, Status.VOLTAGE_LIMIT | far, axial | Status.SENSOR_RANGE, 0]
    other = rig(('current_limit = { channel = "flags", mask = 1 }', 'current_limit = { channel = "pulses" }'))
    assert resolved(other, (STATUS,)) == ("pulses", "flags")
    told = answered(other, (STATUS,), {"flags": np.array([1.0, 4.0]), "pulses": np.array([0.0, 7.0])})[STATUS]
    assert told.tolist() == [0, near | Status.CURRENT_LIMIT]
    assert read_now(other, STATUS, {"flags": 0.0, "pulses": 2.0}) == Status.CURRENT_LIMIT


def test_the_servomotor_has_other_bits_for_the_same_meanings() -> None:
    servomotor = rig(name="tsbs12")
    samples = {name: np.zeros(3) for name in resolved(servomotor, (STATUS,))}
    said = answered(servomotor, (STATUS,), {**samples, "flags": np.array([1.0, 2.0, 8.0])})[STATUS]
    assert said.tolist() == [Status.CURRENT_LIMIT, Status.SEGMENT_LIMIT, Status.CONTACT_FAR]


def stand(*without: str) -> RigFile:
    """The plain stand, whose controller does not say some of it."""
    folder = ROOT / "examples/plain-stand"
    toml = (folder / "stand.toml").read_text(encoding="utf-8")
    begin, end = toml.index("[capabilities.status]"), toml.index("[capture]")
    lines = [line for line in toml[begin:end].splitlines() if not line.startswith(without)]
    kept = toml[:begin] + "\n".join(lines) + "\n" + toml[end:]
    return RigFile.parse(kept, (folder / "stand.dbc").read_text(encoding="cp1252"))


SILENT = ("contact", "current_limit", "voltage_limit", "sensor_range")


def at_rest(of: RigFile) -> dict[str, np.ndarray]:
    samples = {name: np.zeros(3) for name in resolved(of, (STATUS,))}
    return samples | ({"Versorgung": np.full(3, 24.0)} if "Versorgung" in samples else {})


@pytest.mark.parametrize(
    ("changed_to", "told"),
    [({"LageYVorn": [0.0, -150e-6, -192e-6], "LageYHinten": [0.0, -150e-6, -192e-6]},
      [0, 0, Status.CONTACT_NEAR | Status.CONTACT_FAR]),  # 200 um, less some 13 of tolerances
     ({"LageXVorn": [0.0, -90e-6, -120e-6], "LageYVorn": [0.0, -90e-6, -120e-6]}, [0, 0, Status.CONTACT_FAR]),
     ({"StromYObenHinten": [3.4, 3.7, 3.8]}, [0, 0, Status.CURRENT_LIMIT]),  # 3.8 A is what the envelope allows: 98 % of it
     ({"SpannungVorn": [10.0, 22.0, 23.5]}, [0, 0, Status.VOLTAGE_LIMIT]),  # of 24 V
     ({"LageXHinten": [0.0, 100e-6, 255.97e-6], "LageXVorn": [0.0, 0.0, -200e-6]}, [0, 0, Status.SENSOR_RANGE])],
)  # fmt: skip
def test_what_no_bit_tells_is_judged_from_readings(changed_to: dict[str, list[float]], told: list[int]) -> None:
    """Positions against the clearance at the rings' own places, currents, voltages against the supply, the ends of a signal."""
    silent = stand(*SILENT)
    assert bits(silent) == {}
    samples = at_rest(silent) | {name: np.array(x) for name, x in changed_to.items()}
    seen = answered(silent, (STATUS,), samples)[STATUS].tolist()
    assert [s & t if t else s for s, t in zip(seen, told, strict=True)] == told


def test_what_a_bit_tells_is_not_judged() -> None:
    """Of a kind that is bound the controller has the word."""
    assert untold(stand()) == ()
    assert {flag for flag, _ in untold(stand("contact"))} == {Status.CONTACT_NEAR, Status.CONTACT_FAR}
    assert untold(rig()) == ()


def test_rings_in_the_bearings_planes_and_none_at_all() -> None:
    toml, dbc = RIGS["tsbs12"]
    begin, end = toml.index("[capabilities.status]"), toml.index("[parameters]")
    silent = RigFile.parse(toml[:begin] + toml[end:], dbc)
    contacts = {Status.CONTACT_NEAR, Status.CONTACT_FAR}
    assert {flag for flag, _ in untold(silent)} == contacts | {Status.CURRENT_LIMIT, Status.SENSOR_RANGE}
    bare = silent.model_copy(update={"rings": {}})
    assert {flag for flag, _ in untold(bare)} == {Status.CURRENT_LIMIT, Status.SENSOR_RANGE}


def test_an_edge_is_as_old_as_both_clocks_say_however_often_they_came_round() -> None:
    """Ticks of 50 us in 24 bits, an edge in whole microseconds of 32 bits: after two hours the one came round eight times, the
    other once, and what was unwrapped since a bench listens began at no round. By hand: they share 2^25 us."""
    spindle = load_rig(SPINDLE)
    assert edge_round_s(spindle) == 2**25 * 1e-6
    assert whole_channels(spindle) == {"MarkTime"}
    assert not whole_channels(rig()) | whole_channels(rig(name="tsbs12"))
    ticks = np.arange(144_000_000, 144_000_400, 10)  # two hours
    ages = np.linspace(0.0, 0.49, ticks.size)
    edge = np.floor((ticks * 5e-5 - ages) * 1e6) * 1e-6 % (2**32 * 1e-6)
    for heard in (ticks, ticks % 2**24, ticks - 3 * 2**24):
        said = answered(spindle, (AGE,), {"MarkTime": edge, TICKS: heard.astype(np.uint64)})
        assert said.keys() == {AGE, TICKS}
        assert np.abs(said[AGE] - ages).max() < 1.01e-6
    late = answered(spindle, (AGE,), {"MarkTime": ticks[:1] * 5e-5 % (2**32 * 1e-6) + 1e-6, TICKS: ticks[:1]})
    assert late[AGE][0] == pytest.approx(-1e-6, abs=1e-8)


def test_a_tick_that_is_no_whole_number_of_nanoseconds_lets_no_age_drift() -> None:
    """15 kHz: by ticks of 66667 ns an edge was 0.2 ms too old after 40 s, and a vector at 6800 r/min 0.15 rad off.
    By hand: ticks of 24 bits and an edge of 32 bits share 2^26/1.5 us."""
    spindle = load_rig(SPINDLE)
    controller = spindle.devices["controller"].model_copy(update={"tick_s": 6.666666666666667e-5})
    fast = spindle.model_copy(update={"devices": {**spindle.devices, "controller": controller}})
    assert edge_round_s(fast) == pytest.approx(2**26 / 1.5e6)
    ticks = np.arange(0, 15000 * 600, 9970)  # ten minutes
    ages = np.linspace(0.0, 0.49, ticks.size)
    edge = np.floor((ticks / 15000 - ages) * 1e6) * 1e-6 % (2**32 * 1e-6)
    for heard in (ticks, ticks + 5 * 2**24):
        said = answered(fast, (AGE,), {"MarkTime": edge, TICKS: heard.astype(np.uint64)})[AGE]
        assert np.abs(said - ages).max() < 1.01e-6


def test_a_time_is_the_share_of_a_second_that_its_digits_stand_for() -> None:
    assert exact(6.666666666666667e-5) == exact(6.666666667e-5) == Fraction(1, 15000)
    assert exact(5e-5) == Fraction(1, 20000)
    assert exact(1.04e-4) == Fraction(104, 10**6)
    assert exact(6.6667e-5) == Fraction(66667, 10**9)
