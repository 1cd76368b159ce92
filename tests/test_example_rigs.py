"""The rigs of examples/ that another laboratory might have: their files are sound, and cantools reads their frames as we do."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import cantools
import pytest
from heard import START_NS

from bench import catalogue, units
from bench.cli.abilities import abilities
from bench.link.codec import Decoder, encode
from bench.link.frames import batch_of, packed
from bench.link.telemetry import TelemetryDecoder
from bench.rigfile import RigFile, load_rig, protection
from bench.rigfile.busload import bus_load
from bench.rigfile.check import check_rig
from bench.rigfile.messages import Signal
from bench.rigfile.places import Places
from bench.rigfile.toleranced import Toleranced
from drivers.dialogue import commanded
from drivers.sight import Sight

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
SPINDLE, STAND = EXAMPLES / "vertical-spindle/spindle.toml", EXAMPLES / "plain-stand/stand.toml"
RIGS = pytest.mark.parametrize("path", [SPINDLE, STAND], ids=["spindle", "stand"])
SHARES = (0.0, 1 / 3, 1.0)  # shares of what a signal's bits hold


def database(path: Path) -> Any:
    """The DBC as cantools reads it, by itself."""
    rig = load_rig(str(path))
    return cantools.database.load_file(path.parent / rig.link.dbc, database_format="dbc", encoding=rig.link.encoding)


def span(s: Signal) -> tuple[int, int]:
    """The least and the greatest number that its bits hold."""
    return (-(1 << s.length - 1), (1 << s.length - 1) - 1) if s.signed else (0, (1 << s.length) - 1)


def held(rig: RigFile, channel: str) -> tuple[float, float]:
    """The least and the greatest reading that a channel's signal holds, SI."""
    message, _, name = rig.channels[channel].signal.partition(".")
    s = rig.messages[message].signal(name)
    unit = units.UNITS[s.unit]
    low, high = ((raw * s.scale + s.offset) * unit.factor + unit.offset for raw in span(s))
    return low, high


@RIGS
def test_nothing_is_wrong_with_the_files(path: Path) -> None:
    assert check_rig(str(path))[0] == ()


def test_the_bus_of_the_stand_carries_its_five_messages() -> None:
    """Of 7 bytes: 34 + 56 = 90 bits, 22 stuffed, 13 behind: 125. Of 8: 135. Three and two at 500 Hz are 322.5 kbit/s of 500."""
    rig = load_rig(str(STAND))
    load = bus_load(rig.messages, rig.link.bitrate or 0.0, rig.link.data_bitrate)
    assert sum(load.by_message[m] for m in rig.binding.telemetry) == pytest.approx(500 * (3 * 125 + 2 * 135) / 500e3)
    assert load.total < 0.8


def test_the_bus_of_the_spindle_carries_two_thousand_frames() -> None:
    """64 bytes of CAN FD: 34 bits at 1 Mbit/s and 680 at 5: 170 us."""
    rig = load_rig(str(SPINDLE))
    load = bus_load(rig.messages, rig.link.bitrate or 0.0, rig.link.data_bitrate)
    assert load.by_message["SpindleLive"] == pytest.approx(2000 * 170e-6)
    assert load.total < 0.4


def test_the_telemetry_of_the_stand_is_classic_and_big_endian() -> None:
    rig = load_rig(str(STAND))
    messages = [rig.messages[m] for m in rig.binding.telemetry]
    assert len(messages) == 5
    assert {m.period_s for m in messages} == {2e-3}
    assert not any(m.fd or s.little_endian for m in messages for s in m.signals)


@RIGS
def test_every_bound_signal_is_in_the_dbc_as_cantools_reads_it(path: Path) -> None:
    rig, known = load_rig(str(path)), database(path)
    bound = [c.signal for c in rig.channels.values()] + [p.signal for p in rig.parameters.values()]
    bound += [signal for values in rig.binding.commands.values() for signal in values]
    for signal in bound:
        message, _, name = signal.partition(".")
        assert name in known.get_message_by_name(message).signal_tree


@RIGS
def test_telemetry_reads_the_same_in_cantools_from_end_to_end(path: Path) -> None:
    rig, known = load_rig(str(path)), database(path)
    for message in map(rig.messages.__getitem__, rig.binding.telemetry):
        for share in SHARES:
            raw = {s.name: round((1 - share) * span(s)[0] + share * span(s)[1]) for s in message.signals}
            payload = known.encode_message(message.name, raw, scaling=False, padding=True, strict=False)
            theirs = known.decode_message(message.name, payload, decode_choices=False)
            ours = Decoder(message).decode_one(payload)
            for s in message.signals:
                assert theirs[s.name] == pytest.approx(raw[s.name] * s.scale + s.offset, rel=1e-12)
                assert ours[s.name] == pytest.approx(theirs[s.name], rel=1e-12)


@RIGS
def test_what_the_host_sends_reads_the_same_in_cantools(path: Path) -> None:
    rig, known = load_rig(str(path)), database(path)
    for p in rig.parameters.values():
        message, _, name = p.signal.partition(".")
        unit = units.UNITS[rig.messages[message].signal(name).unit]
        for value in (p.low, p.default, p.high):
            payload = encode(rig.messages[message], {name: (value - unit.offset) / unit.factor})
            read = known.decode_message(message, payload, decode_choices=False)[name]
            step = abs(rig.messages[message].signal(name).scale)
            assert abs(float(read) - (value - unit.offset) / unit.factor) <= 0.501 * step
    for name, values in rig.binding.commands.items():
        for message, raw in commanded(rig, name).items():
            read = known.decode_message(message, encode(rig.messages[message], raw))
            assert {f"{message}.{s}": x for s, x in read.items() if f"{message}.{s}" in values} == dict(values)


@RIGS
def test_commands_can_be_told_apart(path: Path) -> None:
    sent = [tuple(sorted(values.items())) for values in load_rig(str(path)).binding.commands.values()]
    assert len(set(sent)) == len(sent)


def test_names_in_cp1252_arrive_as_they_were_written() -> None:
    rig, known = load_rig(str(STAND)), database(STAND)
    status = known.get_message_by_name("StandStatus")
    payload = status.encode({s.name: 0 for s in status.signals} | {"Zustand": "Läuft"})
    assert rig.choices("state")[int(Decoder(rig.messages["StandStatus"]).decode_one(payload)["Zustand"])] == "Läuft"
    assert rig.binding.mode("Läuft") == rig.binding.mode("Läuft mit Anregung") == "LEVITATED"
    assert rig.messages["StandLage"].signal("LageYVorn").unit == "µm"
    with pytest.raises(UnicodeDecodeError):
        (STAND.parent / rig.link.dbc).read_text(encoding="utf-8")


@RIGS
def test_what_matters_is_protected_and_a_trip_fits_its_signal(path: Path) -> None:
    rig = load_rig(str(path))
    protected = {p.name: p for p in protection.all_of(rig)}
    coils = {name for b in rig.bearings.values() for axis in b.axes.values() for name in axis.coils}
    needed = coils | {p.channel for p in rig.probes.values()} | {rig.envelope.supply}
    assert needed <= protected.keys()
    for name in protected.keys() & rig.channels.keys():
        low, high = held(rig, name)
        stated = [x for x in (protected[name].low, protected[name].high) if math.isfinite(x)]
        assert any(low < x < high for x in stated), name
    assert all(u.why for u in protection.without(rig))


def pull(rig: RigFile, key: str, bearing: str, current: float, away: float = 0.0) -> float:
    """What a coil of a bearing pulls with, N; `away`: how much farther than its gap the shaft is, m."""
    beta, gap = rig.simulation[key], rig.bearings[bearing].gap
    gap = Places(rig).number(gap, "gap").number if gap is not None else gap
    assert isinstance(beta, Toleranced)
    assert isinstance(gap, Toleranced)
    return beta.value * (current / (gap.value + away)) ** 2


def weight(rig: RigFile) -> float:
    assert rig.shaft is not None
    assert isinstance(rig.shaft.mass, Toleranced)
    return rig.shaft.mass.value * rig.site.gravity.value


def test_the_spindle_can_fly() -> None:
    """A quarter of what its axial bearing gives, carried below the bias, and lifted from the stop by twice the bias."""
    rig = load_rig(str(SPINDLE))
    bias = rig.parameters["BiasThrust"].default
    assert weight(rig) == pytest.approx(
        0.25 * pull(rig, "beta_Thrust", "thrust", rig.simulation["current_limit"]), rel=0.01
    )
    assert weight(rig) < pull(rig, "beta_Thrust", "thrust", 2 * bias)
    assert 1.5 * weight(rig) < pull(rig, "beta_Thrust", "thrust", 2 * bias, 150e-6)


def test_the_stand_can_fly() -> None:
    """Of two bearings 130 mm before and 150 mm behind the centre of mass the front one carries 150/280."""
    rig = load_rig(str(STAND))
    places, bias = Places(rig), rig.parameters["VormagnetVorn"].default
    at = {name: places.place(f"bearings/{name}").value for name in ("vorn", "hinten")}
    front = weight(rig) * -at["hinten"] / (at["vorn"] - at["hinten"])
    assert front == pytest.approx(16.81, abs=0.01)
    assert front == pytest.approx(0.25 * pull(rig, "beta", "vorn", rig.simulation["current_limit"]), rel=0.02)
    assert 1.3 * front < pull(rig, "beta", "vorn", 2 * bias, 200e-6)


@RIGS
def test_a_sample_is_a_whole_number_of_ticks(path: Path) -> None:
    rig = load_rig(str(path))
    ticks = rig.messages[rig.binding.telemetry[0]].period_s / rig.devices["controller"].tick_s
    assert ticks == pytest.approx(round(ticks))


@RIGS
def test_each_procedure_says_what_it_makes_of_the_rig(path: Path) -> None:
    found = abilities(load_rig(str(path)))
    assert [a.procedure for a in found] == [entry.name for entry in catalogue.PROCEDURES]
    assert not any(a.problems for a in found)
    assert all(a.able or a.lacking or a.unfit for a in found)


def test_a_shaft_that_something_turns_has_a_speed_and_one_that_nothing_turns_has_none(tmp_path: Path) -> None:
    assert "speed" not in load_rig(str(STAND)).channels
    lines = SPINDLE.read_text(encoding="utf-8").splitlines()
    toml = "\n".join(line for line in lines if not line.startswith("SpinRate = {"))
    (tmp_path / "spindle.toml").write_text(toml, encoding="utf-8")
    (tmp_path / "spindle.dbc").write_bytes((SPINDLE.parent / "spindle.dbc").read_bytes())
    assert {"mark.speed"} <= {p.key for p in check_rig(str(tmp_path / "spindle.toml"))[0]}


def test_a_shaft_that_nothing_turns_is_slow_while_telemetry_goes_on() -> None:
    """Make-safe lands a shaft only if something says that it is slow; once the telemetry stands, nothing does."""
    rig, now = load_rig(str(STAND)), [START_NS]
    telemetry = TelemetryDecoder(rig)
    sight = Sight(rig, telemetry, lambda: "LEVITATED", lambda: now[0])
    assert sight.speeds_rad_s() == {}
    frames = []
    for k in range(20):
        now[0] = START_NS + k * 2_000_000
        for name in rig.binding.telemetry:
            values = {"Nummer": k, "Takt": 16 * k, "Zustand": 4} if name == "StandStatus" else {"Zaehler": k}
            values |= {"LageYVorn": 0.03125 * k} if name == "StandLage" else {}
            frames.append(packed(rig.messages[name].identifier, encode(rig.messages[name], values), t_ns=now[0]))
    for one in frames:
        sight.samples(telemetry.decode(batch_of([one])))
    assert list(sight.speeds_rad_s().values()) == [0.0]
    now[0] += 5_000_000_000
    assert sight.speeds_rad_s() == {}
