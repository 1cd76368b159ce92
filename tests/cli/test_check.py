"""`bench check RIG [PROCEDURE]`: every problem in one pass, and what the rig can run."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from bench import catalogue
from bench.cli.__main__ import main
from bench.errors import ConfigError
from bench.rigfile import load_rig
from sim_backend.truth import draw

HEAVY = (
    "scipy",
    "pandas",
    "matplotlib",
    "pyarrow",
    "jinja2",
    "pymodbus",
    "serial",
    "sim_backend",
    "drivers",
    "reports",
)
RIGS = Path(__file__).resolve().parents[2] / "rigs"


def check(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    status = main(("check", *arguments))
    return status, *capsys.readouterr()


def test_a_rig_is_told_what_it_can_run(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = check(capsys, "tsbs12")
    assert (status, err) == (0, "")
    able, _, unable = out.partition("cannot run:\n")
    assert "can run: amb-calibration, force-constant" in able
    assert "  step: sensors: found no pos_z, i_z_p, i_z_n\n" in unable
    assert "amb-calibration" not in unable
    assert max(map(len, out.splitlines())) <= 80


def test_a_rigs_procedures_are_listed_with_what_is_missing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(("list", "--rig", "tsbs12")) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert re.search(r"^  amb-calibration +yes$", out, re.MULTILINE)
    assert re.search(r"^  step +no: sensors: found no pos_z, i_z_p, i_z_n$", out, re.MULTILINE)
    assert [x.split()[0] for x in out.splitlines() if "  yes" in x or "  no: " in x] == [
        entry.name for entry in catalogue.PROCEDURES
    ]
    assert max(map(len, out.splitlines())) <= 80
    assert main(("list", "--rig", "tsbs13")) == 2
    assert "Did you mean tsbs12?" in capsys.readouterr().err


def test_listing_them_imports_no_numerics() -> None:
    """It is to take half a second: what computes is imported where it computes. A live run imports it before it starts."""
    code = (
        "import sys; from bench.cli.__main__ import main; main(['list', '--rig', 'tsbs12']); "
        f"print(*sorted({{m.partition('.')[0] for m in sys.modules}} & {set(HEAVY)!r}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == ""


def test_one_procedure_is_told_whole(capsys: pytest.CaptureFixture[str]) -> None:
    assert check(capsys, "amb5dof", "step")[0] == 0
    status, out, _ = check(capsys, "tsbs12", "step")
    assert status == 2
    assert "tsbs12.toml cannot run step" in out
    assert "sensors: found no pos_z, i_z_p, i_z_n" in out
    status, _, err = check(capsys, "tsbs12", "stepp")
    assert status == 2
    assert "Did you mean step?" in err


@pytest.mark.parametrize(
    ("rig", "old", "new", "said"),
    [
        (
            "tsbs12",
            "pos_yi",
            "lage_yi",
            "channels.lage_yi: found what the simulated tsbs has no reading for; expected `lage_yi = ",
        ),
        (
            "amb5dof",
            "pos_zo",
            "lage_zo",
            "channels.lage_zo: found what the simulated amb5dof has no reading for; expected",
        ),
        ("tsbs12", "Telemetry", "Messwerte", "binding.sequence: found no message 'Telemetry' in the DBC; expected"),
        (
            "tsbs12",
            "BO_ 16 Heartbeat",
            "BO_ 256 Heartbeat",
            "BO_ Heartbeat: found identifier 0x100, which Telemetry has too",
        ),
    ],
)
def test_a_dbc_that_nothing_can_be_simulated_over_is_told(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, rig: str, old: str, new: str, said: str
) -> None:
    for kind in ("toml", "dbc"):
        text = (RIGS / f"{rig}.{kind}").read_text(encoding="utf-8")
        (tmp_path / f"{rig}.{kind}").write_text(re.sub(rf"\b{old}\b", new, text), encoding="utf-8")
    status, _, err = check(capsys, str(tmp_path / f"{rig}.toml"))
    assert status == 2
    assert said in err
    if "no reading" in said:
        with pytest.raises(ConfigError, match="cannot be simulated"):
            draw(load_rig(str(tmp_path / f"{rig}.toml")), 1)


def test_plans_limits_and_the_simulated_machine_are_checked_too(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What `bench run` would refuse is said by `bench check`, with all the rest."""
    text = (RIGS / "tsbs12.toml").read_text(encoding="utf-8")
    for old, new in (
        ("[plans.amb-calibration]\n", "[plans.amb-calibraton]\nangles = 9\n[plans.amb-calibration]\nangels = 9\n"),
        ('machine = "tsbs"', 'machine = "mine"'),
        ("clearance = { value = 0.25", "clearance = { value = 0.6"),
    ):
        assert old in text
        text = text.replace(old, new, 1)
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    (tmp_path / "tsbs12.dbc").write_bytes((RIGS / "tsbs12.dbc").read_bytes())
    (tmp_path / "specs").mkdir()
    (tmp_path / "specs" / "tsbs12.toml").write_text(
        'schema = 1\n[limits.spindown]\nB = { low = 0, unit = "N m s/rad", source = "x", verified = false, '
        "at = { bias = 3 } }\n"
    )
    monkeypatch.chdir(tmp_path)
    status, _, err = check(capsys, "rig.toml")
    assert status == 2
    for said in (
        "plans.amb-calibraton: found amb-calibraton; expected the name of a procedure, such as amb-calibration",
        "angels: found 9",
        "simulation.machine: found 'mine'; expected one of tsbs, tsbs6, amb5dof",
        "geometry.clearance.value",
        "limits.spindown.B.at.bias",
    ):
        assert said in err


WRONG = {
    "uut.colour": ('serial = "SIM-0001"', 'serial = "SIM-0001"\ncolour = "red"'),
    "site.latitude_deg": ("latitude_deg = 53.527", 'latitude_deg = "north"'),
    "geometry.hook_to_outboard.unit": ('150.0, unit = "mm"', '150.0, unit = "furlong"'),
    "geometry.clearance.value": ("clearance = { value = 0.25", "clearance = { value = 0.6"),
    "geometry.motor_stiffness.value": ("motor_stiffness = { value = 242.6", "motor_stiffness = { value = 0"),
    "envelope.max_temperature_K": ("max_temperature_K = 353.0\n", ""),
    "envelope.positions": ('positions = ["pos_xi"', 'positions = ["pos_q"'),
    "envelope.max_supply_V": ("min_supply_V = 130.0", "min_supply_V = 230.0"),
    "devices.drive.registers.target_speed": (
        'scale = 0.01, unit = "r/min", writable',
        'scale = 0, unit = "r/min", writable',
    ),
    "devices.drive.registers.torque.unit": ('scale = 0.01, unit = "N m"', 'scale = 0.01, unit = "Newton"'),
    "devices.drive.link": ('link = "fieldbus"\nroles = ["drive"]', 'link = "feldbus"\nroles = ["drive"]'),
    "devices.supply.poll_s": (
        'roles = ["supply"]\nunit = 2\npoll_s = 0.5',
        'roles = ["supply"]\nunit = 2\npoll_s = 0.001',
    ),
    "devices.supply.registers.voltage.protect": (
        'about = "output voltage"',
        'about = "", protect = { low = 2, high = 1 }',
    ),
    "devices.thermal.roles.0": ('roles = ["thermal"]', 'roles = ["thermometer"]'),
    "links.fieldbus.url": ('url = "modbus-tcp:127.0.0.1:28503"', 'url = "modbus:127.0.0.1"'),
    "channels.i_z_n.signal": ('"Telemetry.i_z_n"', '"Telemetry.i_xi_p"'),
    "channels.temp_m.signal": ('"Telemetry.temp_m"', '"Telemetry.temp_q"'),
    "parameters.bias_i.defualt": ("default = 3, low = 0", "default = 9, defualt = 3, low = 0"),
    "parameters.bias_i.default": ("", ""),  # of the same line
    "[plans.amb-calibration]: angels": ("[plans.amb-calibration]\n", "[plans.amb-calibration]\nangels = 9\n"),
    "simulation.machine": ('machine = "tsbs"', 'machine = "mine"'),
}


def test_all_that_is_wrong_is_told_in_one_pass(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Unlike errors, of types, of values, of what belongs together, in the file, its plans and its DBC: none hides another, and
    what is only a consequence of one that is told is not told beside it."""
    text = (RIGS / "tsbs12.toml").read_text(encoding="utf-8")
    for old, new in WRONG.values():
        assert old in text
        text = text.replace(old, new, 1)
    dbc = (RIGS / "tsbs12.dbc").read_text(encoding="utf-8")
    dbc = dbc.replace('[-0.00065536|0.00065534] "m" Host', '[-0.00065536|0.00065534] "thou" Host', 1)
    dbc = dbc.replace("BO_ 16 Heartbeat:", "BO_ 16 Heartbeet:", 1)
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    (tmp_path / "tsbs12.dbc").write_text(dbc, encoding="utf-8")
    status, _, err = check(capsys, str(tmp_path / "rig.toml"))
    assert status == 2
    *problems, last = err.splitlines()
    keys = [line.partition(": found ")[0].split(maxsplit=1)[-1].split("rig.toml: ")[-1] for line in problems]
    assert sorted(keys) == sorted([*WRONG, "Telemetry.pos_xi", "devices.controller.binding.heartbeat"])
    assert last.endswith(f"{len(WRONG) + 2} problems")
