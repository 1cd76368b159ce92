"""What is protected follows the machine: every current, temperature, speed, position and supply by its unit and role, with its
own limit or its kind's, and each of them trips."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from test_rigfile import TOML, changed, written

from bench.cli.__main__ import main
from bench.errors import InterlockError
from bench.rigfile import RigFile, load_rig, protection
from bench.rigfile.check import check_rig
from bench.rigfile.envelope import Envelope
from bench.rigfile.protection import Protected
from bench.samples import SampleBlock

ROOT = Path(__file__).resolve().parent.parent
OWN = [(ROOT / "examples" / "own-controller" / f"plainamb.{x}").read_text(encoding="utf-8") for x in ("toml", "dbc")]
INF = math.inf
# As protection by name had them (i_*, temp_*, speed, supply, the list of positions), in its order.
BEFORE = {
    "tsbs12": (
        [(n, -12.5, 12.5) for n in ("i_xi_p", "i_xi_n", "i_yi_p", "i_yi_n", "i_xo_p", "i_xo_n", "i_yo_p", "i_yo_n",
                                    "i_z_p", "i_z_n", "i_m1", "i_m2", "i_m3", "i_m4")]
        + [(n, -INF, 353.0) for n in ("temp_i", "temp_o", "temp_m")] + [("speed", -75.0, 75.0)],
        [("supply", 130.0, 160.0), *((n, -150e-6, 150e-6) for n in ("pos_xi", "pos_yi", "pos_xo", "pos_yo"))],
        {"drive": [("actual_speed", -75.0, 75.0), ("torque", -10.0, 10.0)], "supply": [("voltage", 130.0, 160.0)],
         "thermal": [(n, -INF, 353.0) for n in ("temp_i", "temp_o", "temp_m")]},
    ),
    "amb5dof": (
        [(n, -3.2, 3.2) for n in ("i_yi_p", "i_yi_n", "i_zi_p", "i_zi_n", "i_yo_p", "i_yo_n", "i_zo_p", "i_zo_n", "i_x_p",
                                  "i_x_n")]
        + [(n, -INF, 353.0) for n in ("temp_i", "temp_o", "temp_x")] + [("speed", -1571.0, 1571.0)],
        [("supply", 11.0, 52.0), *((n, -120e-6, 120e-6) for n in ("pos_yi", "pos_zi", "pos_yo", "pos_zo"))],
        {"drive": [("actual_speed", -1571.0, 1571.0), ("torque", -0.1, 0.1)], "supply": [("voltage", 11.0, 52.0)],
         "thermal": [(n, -INF, 353.0) for n in ("temp_i", "temp_o", "temp_x")]},
    ),
}  # fmt: skip


def limits(found: tuple[Protected, ...], held: bool) -> list[tuple[str, float, float]]:
    return [(p.name, p.low, p.high) for p in found if p.held is held]


@pytest.mark.parametrize("rig", BEFORE)
def test_the_two_rigs_protect_what_they_always_did(rig: str) -> None:
    file = load_rig(rig)
    always, held, registers = BEFORE[rig]
    assert limits(protection.of_channels(file), held=False) == always
    assert limits(protection.of_channels(file), held=True) == held
    found = {d: [(n, p.low, p.high) for n, p in protection.of_registers(file, d).items()] for d in file.devices}
    assert {d: f for d, f in found.items() if f} == registers
    assert [n for n, p in protection.of_registers(file, "supply").items() if p.held] == ["voltage"]


def beyond() -> Iterator[tuple[str, str, float]]:
    """Every end of every limit of both rigs, and no number."""
    for rig in BEFORE:
        for p in protection.all_of(load_rig(rig)):
            ends = [x + sign * 0.01 * abs(x) for x, sign in ((p.low, -1), (p.high, 1)) if math.isfinite(x)]
            yield from ((rig, p.name, value) for value in ends)


def block(rig: RigFile, state: str, **values: float) -> SampleBlock:
    """Three samples in the middle of every limit, the second with `values`."""
    middle = {n: np.zeros(3) for n in rig.channels}
    for p in protection.of_channels(rig):
        middle[p.name][:] = (p.low + p.high) / 2 if math.isfinite(p.low) else p.high / 2
    middle["state"][:] = next(code for code, name in rig.choices("state").items() if rig.binding.mode(name) == state)
    for name, value in values.items():
        middle[name][1] = value
    return SampleBlock("telemetry", 0, np.array([10, 20, 30], np.uint64), np.zeros(3, np.int64), 0, 0, middle)


@pytest.mark.parametrize(("rig", "name", "value"), [*beyond()])
def test_every_protected_reading_trips_and_is_named(rig: str, name: str, value: float) -> None:
    file = load_rig(rig)
    guard, (p,) = Envelope(file), [p for p in protection.all_of(file) if p.name == name]
    device, _, register = name.partition(" ")
    said = re.escape(f"interlock: {name} ") + r"(reached|fell to) "
    if register:
        with pytest.raises(InterlockError, match=said):
            guard.check_reading(device, {register: value}, held=True)
        if p.held:
            guard.check_reading(device, {register: value}, held=False)
        return
    guard.check_block(block(file, "LEVITATED"))
    for state in ("READY", "LEVITATED", "SPINNING"):
        if state == "READY" and p.held:
            guard.check_block(block(file, state, **{name: value}))
            continue
        with pytest.raises(InterlockError, match=f"{said}.* at tick 20; the envelope"):
            guard.check_block(block(file, state, **{name: value}))


@pytest.mark.parametrize("name", ["i_xi_p", "temp_i", "speed", "pos_yo", "supply"])
def test_what_is_no_number_trips(name: str) -> None:
    rig = load_rig("tsbs12")
    with pytest.raises(InterlockError, match=f"{name} reached nan"):
        Envelope(rig).check_block(block(rig, "LEVITATED", **{name: math.nan}))


def test_names_of_its_own_protect_a_rig_as_well() -> None:
    """Every channel but those that the bench knows by name is called otherwise; nothing else is changed."""
    toml, dbc = OWN
    names = [n for n in RigFile.parse(toml, dbc).channels if n not in ("state", "fault", "flags", "speed")]
    other = {name: f"kanal_{k}" for k, name in enumerate(names)}
    table = toml[toml.index("[channels]") : toml.index("[parameters]")]
    renamed = RigFile.parse(
        toml.replace(table, re.sub(r"^(\w+) =", lambda m: f"{other.get(m[1], m[1])} =", table, flags=re.M)), dbc
    )
    before = protection.all_of(RigFile.parse(toml, dbc))
    assert {other.get(p.name, p.name) for p in before} == {p.name for p in protection.all_of(renamed)}
    assert len(before) == 9 + 1 + 1 + 4
    with pytest.raises(InterlockError, match=r"kanal_0 reached 0\.0002 m"):
        Envelope(renamed).check_block(block(renamed, "LEVITATED", kanal_0=2e-4))


POS_Z, I_Z = 'about = "shaft position, axial", noise = 5e-8', 'about = "coil current z, positive side", noise = 1.5e-3'


def test_a_channel_may_have_a_limit_of_its_own(tmp_path: Path) -> None:
    toml = changed(
        TOML,
        (POS_Z, f"{POS_Z}, protect = {{ low = -2e-4, high = 1e-4 }}"),
        (I_Z, f"{I_Z}, protect = {{ high = 3 }}"),
        (
            'unit = "V", about = "output voltage"',
            'unit = "V", about = "output voltage", protect = { low = 140, when = "always" }',
        ),
        (
            'unit = "A", about = "output current"',
            'unit = "A", about = "output current", protect = { low = 0, high = 20 }',
        ),
    )
    assert check_rig(written(tmp_path, toml))[0] == ()
    rig = load_rig(str(tmp_path / "rig.toml"))
    found = {p.name: p for p in protection.all_of(rig)}
    assert found["pos_z"] == Protected("pos_z", -2e-4, 1e-4, "m", "protect", held=True)
    assert found["i_z_p"] == Protected("i_z_p", -INF, 3.0, "A", "protect")
    assert found["supply voltage"] == Protected("supply voltage", 140.0, INF, "V", "protect")
    guard = Envelope(rig)
    guard.check_block(block(rig, "READY", pos_z=5e-4))
    for value, said in ((1.5e-4, "pos_z reached 0.00015 m at tick 20; the envelope allows 0.0001 m"),
                        (-3e-4, "pos_z fell to -0.0003 m at tick 20; the envelope asks for at least -0.0002 m")):  # fmt: skip
        with pytest.raises(InterlockError, match=said):
            guard.check_block(block(rig, "LEVITATED", pos_z=value))
    for register, value, said in (("current", 21.0, "reached 21 A; the envelope allows 20 A"),
                                  ("current", -1.0, "fell to -1 A; the envelope asks for at least 0 A"),
                                  ("voltage", 139.0, "fell to 139 V; the envelope asks for at least 140 V")):  # fmt: skip
        with pytest.raises(InterlockError, match=f"supply {register} {said}"):
            guard.check_reading("supply", {register: value}, held=False)


def test_a_channel_may_be_without_one_for_a_reason(tmp_path: Path) -> None:
    toml = changed(TOML, (I_Z, f'{I_Z}, unprotected = "a set point, no reading"'))
    assert check_rig(written(tmp_path, toml))[0] == ()
    rig = load_rig(str(tmp_path / "rig.toml"))
    Envelope(rig).check_block(block(rig, "LEVITATED", i_z_p=40.0))
    assert {u.name: u.why for u in protection.without(rig)} == {
        "i_z_p": "a set point, no reading", "pos_z": "not in envelope.positions", "supply current": "", "thermal ambient": "",
    }  # fmt: skip


def test_without_a_list_every_position_is_protected(tmp_path: Path) -> None:
    toml = "\n".join(line for line in TOML.splitlines() if not line.startswith("positions ="))
    assert check_rig(written(tmp_path, toml))[0] == ()
    found = {p.name for p in protection.of_channels(load_rig(str(tmp_path / "rig.toml"))) if p.unit == "m"}
    assert found == {"pos_xi", "pos_yi", "pos_xo", "pos_yo", "pos_z"}


def test_the_supply_is_the_channel_that_the_rig_file_says(tmp_path: Path) -> None:
    toml = changed(
        TOML, ("\nsupply = {", "\nbus_voltage = {"), ("max_supply_V", 'supply = "bus_voltage"\nmax_supply_V')
    )
    assert check_rig(written(tmp_path, toml))[0] == ()
    rig = load_rig(str(tmp_path / "rig.toml"))
    with pytest.raises(InterlockError, match="bus_voltage fell to 100 V"):
        Envelope(rig).check_block(block(rig, "LEVITATED", bus_voltage=100.0))


@pytest.mark.parametrize(
    ("changes", "key", "found", "expected"),
    [
        ([(POS_Z, f"{POS_Z}, protect = {{ low = 1, high = -1 }}")], "channels.pos_z.protect", "low 1, high -1", "low < high"),
        ([(POS_Z, f"{POS_Z}, protect = 3")], "channels.pos_z.protect", "3", "a table, as in"),
        ([(POS_Z, f"{POS_Z}, protect = {{}}")], "channels.pos_z.protect", "neither low nor high", "one of them"),
        ([(POS_Z, f'{POS_Z}, protect = {{ high = 1 }}, unprotected = "x"')], "channels.pos_z.unprotected", "a reason",
         "one of the two"),
        ([(POS_Z, f"{POS_Z}, protect = {{ high = 1, above = 2 }}")], "channels.pos_z.protect.above", "2", "no such key"),
        ([('about = "output current"', 'about = "output current", protect = { low = 2, high = 2 }')],
         "devices.supply.registers.current.protect", "low 2, high 2", "low < high"),
        ([('["pos_xi", "pos_yi"', '["pos_q", "pos_yi"')], "envelope.positions", "pos_q", "a channel of this rig"),
        ([('["pos_xi", "pos_yi"', '["i_m1", "pos_yi"')], "envelope.positions", "i_m1 in A", "the kind of m"),
        ([('about = "shaft position, inboard, up"', 'about = "up", unprotected = "x"')], "envelope.positions",
         "pos_yi, which is `unprotected`", "one of the two"),
        ([("max_supply_V", 'supply = "bus"\nmax_supply_V')], "envelope.supply", "bus", "a channel of this rig"),
        ([("max_supply_V", 'supply = "speed"\nmax_supply_V')], "envelope.supply", "speed in rad/s", "the kind of V"),
        ([("max_supply_V = 160", "max_supply_V = 120")], "envelope.max_supply_V", "120", "more than min_supply_V = 130"),
    ],
)  # fmt: skip
def test_protection_that_cannot_be_is_named(
    tmp_path: Path, changes: list[tuple[str, str]], key: str, found: str, expected: str
) -> None:
    (problem,) = check_rig(written(tmp_path, changed(TOML, *changes)))[0]
    assert (problem.key, problem.found[: len(found)]) == (key, found)
    assert expected in problem.expected


def bare(toml: str, unit: str, but: str = "") -> str:
    """The rig file with every channel of a unit without a limit, but one."""
    return re.sub(
        rf'^((?!{but or "-"} )\w+ = \{{ signal = .*unit = "{unit}")', r'\1, unprotected = "x"', toml, flags=re.M
    )


def test_a_levitated_rotor_without_a_position_or_a_current_that_trips_is_refused(tmp_path: Path) -> None:
    toml = "\n".join(line for line in TOML.splitlines() if not line.startswith("positions ="))
    found = {p.found: p.expected for p in check_rig(written(tmp_path, bare(bare(toml, "m"), "A")))[0]}
    assert list(found) == ["no current that is protected, though the rotor levitates",
                           "no position that is protected, though the rotor levitates"]  # fmt: skip
    assert "max_current_A" in found["no current that is protected, though the rotor levitates"]
    assert check_rig(written(tmp_path, bare(bare(toml, "m", "pos_yo"), "A", "i_m1")))[0] == ()
    (empty,) = check_rig(written(tmp_path, re.sub(r"(?m)^positions = .*", "positions = []", TOML)))[0]
    assert empty.found.startswith("no position")
    resting = changed(bare(bare(toml, "m"), "A"), ('roles = ["levitation", "rotation"]', 'roles = ["rotation"]'))
    assert check_rig(written(tmp_path, resting))[0] == ()


@pytest.mark.parametrize("rig", BEFORE)
def test_check_prints_what_protects_a_rig(capsys: pytest.CaptureFixture[str], rig: str) -> None:
    assert main(("check", rig)) == 0
    out = capsys.readouterr().out
    said = out[out.index("protected always:") : out.index("can run:")]
    assert max(map(len, said.splitlines())) <= 80
    words = set(re.findall(r"[\w-]+", said))
    assert {name for p in protection.all_of(load_rig(rig)) for name in p.name.split()} <= words
    always, held = said.split("protected while the rotor is held:\n")
    assert "at most 353 K (max_temperature_K): temp_i, " in always
    assert ("±150 µm" if rig == "tsbs12" else "±120 µm") + " (max_levitated_position_m): pos_" in held
    assert f"without a limit: pos_{'z' if rig == 'tsbs12' else 'x'} (not in envelope.positions); " in held
