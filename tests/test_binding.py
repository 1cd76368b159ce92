"""Bindings of a controller's own messages: every way to get one wrong is a problem with key, found and expected, before
anything is opened."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.errors import ConfigError
from bench.rigfile import binding, load_rig
from bench.rigfile.check import check_rig

ROOT = Path(__file__).resolve().parent.parent
TOML, DBC = ((ROOT / "examples" / "own-controller" / f"plainamb.{x}").read_text() for x in ("toml", "dbc"))
NATIVE_TOML, NATIVE_DBC = ((ROOT / "rigs" / f"tsbs12.{x}").read_text() for x in ("toml", "dbc"))
KEY = "devices.controller.binding"


def problems(folder: Path, toml: str, dbc: str, name: str = "plainamb") -> dict[str, str]:
    """Key to the whole text. A rig that `bench check` refuses, `bench run` refuses too."""
    (folder / f"{name}.toml").write_text(toml)
    (folder / f"{name}.dbc").write_text(dbc)
    found, _ = check_rig(str(folder / f"{name}.toml"))
    if found:
        with pytest.raises(ConfigError):
            load_rig(str(folder / f"{name}.toml"))
    return {p.key: str(p) for p in found}


def swapped(text: str, old: str, new: str) -> str:
    assert old in text, old
    return text.replace(old, new)


IN_TOML = [
    ('"AmbSync", "AmbPos"', '"AmbSynk", "AmbPos"', f"{KEY}.sequence", "no message 'AmbSynk'"),
    ('telemetry = ["AmbSync", "AmbPos", "AmbCurX", "AmbCurY", "AmbRest"]', "telemetry = []", f"{KEY}.telemetry", "at least 1"),
    ('"AmbPos", "AmbCurX"', '"AmbPos", "AmbPos", "AmbCurX"', f"{KEY}.telemetry", "AmbPos twice"),
    (', "AmbRest"]', "]", "channels.speed.signal", "a signal of the telemetry"),
    ('sequence = "SeqNo"', 'sequence = "Seq"', f"{KEY}.sequence", "it has SeqNo, Ticks"),
    ('tick = "Ticks"', "", f"{KEY}.tick", "no signal 'tick'"),
    ('counter = "Rolling"', "", f"{KEY}.counter", "no signal 'count'"),
    ('counter = "Rolling"', 'counter = "XA"', f"{KEY}.counter", "no signal 'XA'"),
    ('heartbeat = "HostAlive"', "", f"{KEY}.heartbeat", "no message 'Heartbeat'"),
    ('heartbeat_counter = "Count"', "", f"{KEY}.heartbeat", "no signal 'counter'"),
    ('heartbeat = "HostAlive"\nheartbeat_counter = "Count"', 'heartbeat = "HostTuning"\nheartbeat_counter = "BiasA"',
     f"{KEY}.heartbeat", "a message of its own"),
    ('"HostControl.Demand" = "Descend"', '"HostControl.Demand" = 2', f"{KEY}.commands.LAND", "the same values as LEVITATE"),
    ('"HostControl.Demand" = "Brake"', '"HostControl.Demand" = "Rotate", "HostControl.SpeedDemand" = 0', f"{KEY}.commands.SPIN",
     "values that are all among those of STOP"),
    ('LAND = { "HostControl.Demand" = "Descend" }\n', "", f"{KEY}.commands.LAND", "no message 'Command'"),
    ('MAKE_SAFE = { "HostControl.Demand" = "Safe" }\n', "", f"{KEY}.commands.MAKE_SAFE", "no message 'Command'"),
    ('"HostControl.Demand" = "Arm"', '"HostControl.Demand" = "Armed"', f"{KEY}.commands.ENABLE", "Standby, Arm, Float"),
    ('"HostControl.Demand" = "Arm"', '"HostControl.Demand" = 256', f"{KEY}.commands.ENABLE", "bits can hold"),
    ('"HostControl.Demand" = "Arm"', '"HostControl.Demnd" = 1', f"{KEY}.commands.ENABLE", "no signal 'Demnd'"),
    ('"HostControl.Demand" = "Arm"', '"HostControl" = 1', f"{KEY}.commands.ENABLE", "no signal ''"),
    ('ENABLE = { "HostControl.Demand" = "Arm" }', "ENABLE = {}", f"{KEY}.commands.ENABLE", "no values"),
    ("CLEAR_FAULT =", "CLEARFAULT =", f"{KEY}.commands.CLEARFAULT", "an unknown command"),
    ('Rising = "LIFTING"\n', "", f"{KEY}.states.Rising", "what Rising amounts to"),
    ('Rising = "LIFTING"', 'Rising = "UP"', f"{KEY}.states.Rising", "expected"),
    ('Rising = "LIFTING"', 'Rising = "LIFTING"\nResing = "OFF"', f"{KEY}.states.Resing", "does not have"),
    ('Armed = "READY"', 'Armed = "OFF"', f"{KEY}.states", "no state that amounts to READY"),
    ('no_fault = ["Ok"]\n', "", f"{KEY}.no_fault", 'no_fault = ["Ok"]'),
    ('no_fault = ["Ok"]', 'no_fault = ["Fine", "Ok"]', f"{KEY}.no_fault", "found Fine; expected names of the value table"),
    ('no_fault = ["Ok"]', 'no_foult = ["Ok"]', f"{KEY}.no_foult", "no such key"),
    ('signal = "AmbSync.Mode"', 'signal = "AmbPos.XA"', "channels.state.signal", "unsigned code"),
    ('state = { signal = "AmbSync.Mode", unit = "1", about = "state of the controller" }\n', "", "channels.state", "watches"),
    ('signal = "HostTuning.BiasA"', 'signal = "HostTuning.BiasQ"', "parameters.bias_i.signal", "it has BiasA"),
    ('signal = "HostTuning.BiasA"', 'signal = "HostTuning.BiasB"', "parameters.bias_o.signal", "a signal of its own"),
    ("default = 3, low = 0, high = 5,", "default = 3, low = 0, high = 70,", "parameters.bias_i",
     "a range that HostTuning.BiasA can hold"),
    ('"HostTuning.BiasA", unit = "A"', '"HostTuning.BiasA", unit = "mA"', "parameters.bias_i.unit", "in SI"),
    ('"HostTuning.BiasA", unit = "A"', '"HostTuning.BiasA", unit = "m"', "parameters.bias_i.unit", "the kind of mA"),
    ('signal = "HostTuning.BiasA"', "index = 1", "parameters", "ParamSet"),
    ("tick_s = 1e-4", "tick_s = 1e-4\nmap_version = 3", "devices.controller.map_version", "Identity"),
    ("tick_s = 1e-4", "tick_s = 1e-10", f"{KEY}.tick", "more bits"),
    ('link = "controller"', 'link = "can"', "devices.controller.link", "one of controller"),
    ("bitrate = 1_000_000\n", "", "links.controller.bitrate", "bit/s"),
    ("bitrate = 1_000_000\n", "bitrate = 500_000\n", "links.controller", "at most 90%"),
    ('url = "can:socketcan:can0"', 'url = "cna:socketcan:can0"', "links.controller.url", "did you mean"),
    ('url = "can:socketcan:can0"', 'url = "line:127.0.0.1:5"', "links.controller.url", "a URL for the controller"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "key", "says"), IN_TOML, ids=[f"{k}:{s}"[:60] for _, _, k, s in IN_TOML])
def test_a_wrong_binding_is_a_problem(tmp_path: Path, old: str, new: str, key: str, says: str) -> None:
    found = problems(tmp_path, swapped(TOML, old, new), DBC)
    assert key in found, found
    assert says in found[key]


ALIVE = "BO_ 16 HostAlive: 4 Bench"
EXTRA = 'BO_ 20 {}: 8 Bench\n SG_ {} : 0|8@1+ (1,0) [0|0] "" PlainAmb\n\n'
IN_DBC = [
    ("SeqNo : 0|16@1+ (1,0)", "SeqNo : 0|16@1+ (2,0)", f"{KEY}.sequence", "scaled"),
    ("SeqNo : 0|16@1+ (1,0)", "SeqNo : 0|8@1+ (1,0)", f"{KEY}.sequence", "more bits"),
    ("Ticks : 16|32@1+", "Ticks : 16|32@1-", f"{KEY}.tick", "signed"),
    ("SG_ Rolling : 7|4@0+", "SG_ Rolling : 6|3@0+", f"{KEY}.telemetry", "at least 4 bits"),
    ('BA_ "GenMsgCycleTime" BO_ 128 1;\n', "", f"{KEY}.telemetry", "GenMsgCycleTime"),
    ("Count : 0|16@1+", "Count : 0|16@1-", f"{KEY}.heartbeat_counter", "signed"),
    ("Count : 0|16@1+ (1,0)", "Count : 0|8@1+ (2,0)", f"{KEY}.heartbeat_counter", "scaled"),
    ("Demand : 0|8@1+ (1,0)", "Demand : 0|8@1+ (0.5,0)", f"{KEY}.commands.ENABLE", "scale 1"),
    ('"Tripped" ;', '"Tripped" 8 "Testing" ;', f"{KEY}.states.Testing", "what Testing amounts to"),
    (ALIVE, f"{EXTRA.format('Claim', 'session')}{ALIVE}", "message Claim", "Owner too"),
    (ALIVE, f"{EXTRA.format('Own', 'x').replace('20', '2047')}{ALIVE}", "BO_ Own", "the sign of a served simulation"),
    (ALIVE, f"{EXTRA.format('Identity', 'what')}{ALIVE}", "message Identity", "Identity"),
    ('(0.025,0) [-409.6|409.575] "um"', '(0.025,0) [-409.6|409.575] "parsec"', "AmbPos.XA", "a known unit"),
    ('"mA" PlainAmb', '"furlong" PlainAmb', "HostTuning.BiasA", "a known unit"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "key", "says"), IN_DBC, ids=[f"{k}:{s}"[:60] for _, _, k, s in IN_DBC])
def test_a_dbc_that_cannot_be_bound_is_a_problem(tmp_path: Path, old: str, new: str, key: str, says: str) -> None:
    found = problems(tmp_path, TOML, swapped(DBC, old, new))
    assert key in found, found
    assert says in found[key]


def test_other_devices_and_links_are_looked_at(tmp_path: Path) -> None:
    toml = swapped(NATIVE_TOML, 'url = "modbus-tcp:127.0.0.1:28503"', 'url = "slcan:/dev/ttyACM0"')
    toml = swapped(toml, 'url = "line:127.0.0.1:28504"', 'url = "line:127.0.0.1"')
    toml = swapped(toml, '[devices.supply]\n', '[devices.supply]\n').replace('link = "fieldbus"\nroles = ["supply"]',
                                                                            'link = "feldbus"\nroles = ["supply"]')  # fmt: skip
    found = problems(tmp_path, toml, NATIVE_DBC, "tsbs12")
    assert "such as modbus-tcp:" in found["links.fieldbus.url"]
    assert "HOST:PORT" in found["links.operator.url"]
    assert "one of controller, fieldbus, operator" in found["devices.supply.link"]


def test_what_a_name_means_without_a_binding() -> None:
    own, native = load_rig(str(ROOT / "examples" / "own-controller" / "plainamb.toml")), load_rig("tsbs12")
    assert native.binding.command("SPIN") == {"Command.code": "SPIN"}
    assert own.binding.command("SPIN") == {"HostControl.Demand": "Rotate"}
    assert [native.binding.mode(x) for x in ("COASTING", "Coasting")] == ["COASTING", None]
    assert [own.binding.mode(x) for x in ("RunDown", "OFF", "Nonsense")] == ["COASTING", "OFF", None]
    for name in binding.LEVITATION_COMMANDS:
        assert native.binding.knows(name, native.messages)
        assert own.binding.knows(name, own.messages) == (name not in ("IDENTIFY", "RELEASE"))
