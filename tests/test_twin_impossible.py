"""What no machine can be under `[simulation]`, and by `--truth`: `bench check` tells each and a run is refused, all at once."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.cli.check import check_rig_file
from bench.errors import ConfigError
from bench.rigfile import RigFile
from sim_backend.draws import draw_one
from sim_backend.machines.table import machine_of
from sim_backend.machines.twin.keys import BY_AXIS, BY_JOURNAL, BY_PLANE, OF_ALL, ONCE, OWN
from sim_backend.machines.twin.possible import KEYS, cannot_be
from sim_backend.truth import draw

STAND = Path(__file__).parents[1] / "examples" / "plain-stand" / "stand.toml"
TEXT, DBC = STAND.read_text(encoding="utf-8"), STAND.with_suffix(".dbc").read_text(encoding="cp1252")


def stated(*lines: str) -> str:
    """The stand with other lines under `[simulation]`, in place of those of the same keys."""
    head, table, rest = TEXT.partition("[simulation]\n")
    keys = tuple(f"{line.partition('=')[0].strip()} =" for line in lines)
    kept = "\n".join(x for x in rest.split("\n") if not x.startswith(keys))
    return "\n".join((f"{head}{table.rstrip()}", *lines, kept))


def told(text: str) -> dict[str, tuple[str, str]]:
    """What a run says of a rig file, by key."""
    with pytest.raises(ConfigError) as caught:
        draw(RigFile.parse(text, DBC, "stand.toml"), 1)
    return {p.key.removeprefix("simulation."): (p.found, p.expected) for p in caught.value.problems}


def test_each_key_of_a_twin_has_what_it_may_be() -> None:
    keys = {*OF_ALL, *ONCE, *OWN, *BY_AXIS, *BY_PLANE, *BY_JOURNAL, "kp", "ki", "kd", "bias", "position_noise"}
    assert keys - KEYS.keys() == {"machine"}


@pytest.mark.parametrize(
    ("line", "key", "found", "expected"),
    [
        ("mass = -1", "mass", "-1 kg", "more than 0 kg"),
        ("mass = 0", "mass", "0 kg", "more than 0 kg"),
        ("bandwidth = 0", "bandwidth", "0 Hz", "more than 0 Hz"),
        ("supply_V = 0", "supply_V", "0 V", "more than 0 V"),
        ("slew = -1", "slew", "-1 m/s", "0 m/s or more"),
        ("position_noise = -2e-7", "position_noise", "-2e-07 m", "0 m or more"),
        ("current_noise = -1", "current_noise", "-1 A", "0 A or more"),
        ("inductance = 0", "inductance", "0 H", "more than 0 H"),
        ("resistance = -0.5", "resistance", "-0.5 Ohm", "more than 0 Ohm"),
        ("amplifier_hz = 0", "amplifier_hz", "0 Hz", "more than 0 Hz"),
        ("current_limit = -3.5", "current_limit", "-3.5 A", "more than 0 A"),
        ("drive_limit = -1", "drive_limit", "-1 N m", "0 N m or more"),
        ("trip_speed = 0", "trip_speed", "0 rad/s", "more than 0 rad/s"),
        ("beta = nan", "beta", "nan", "a finite number, more than 0 N m^2/A^2"),
        ("unbalance = inf", "unbalance", "inf", "a finite number, 0 kg m or more"),
        ("pulse_angle = -inf", "pulse_angle", "-inf", "a finite number"),
        ("mass = true", "mass", "true", "a number: more than 0 kg"),
        ("mode_1_on = true", "mode_1_on", "true", "a number: 0 or 1"),
        ("mode_1_on = 2", "mode_1_on", "2", "0 or 1"),
        ('mass = "5"', "mass", "'5'", "a number: more than 0 kg"),
        ("tilt = 45", "tilt", "45 rad", "-1.571 to 1.571 rad"),
        ("beta_x_vorn = -1e-6", "beta_x_vorn", "-1e-06 N m^2/A^2", "more than 0 N m^2/A^2"),
        ("kp = { x_vorn = -1e4 }", "kp.x_vorn", "-10000 A/m", "0 A/m or more"),
        ('resistance = { value = 1, unit = "V", half_width = 0.1, distribution = "rectangular", source = "d" }', "resistance",
         "V", "a unit of the kind of Ohm"),
        ('resistance = { value = 1, unit = "Ohm", half_width = 2, distribution = "rectangular", source = "d" }', "resistance",
         "1 ± 2 Ohm", "a tolerance that leaves it positive: look at the units of both"),
        ('"geometry.luftspalt" = -1', "geometry.luftspalt", "-1", "more than 0"),
    ],
)  # fmt: skip
def test_a_value_that_cannot_be_refuses_a_run(line: str, key: str, found: str, expected: str) -> None:
    assert told(stated(line))[key] == (found, expected)


def test_all_are_told_at_once_by_check_and_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    weighed = next(x for x in TEXT.split("\n") if x.startswith("mass = ") and '"weighed"' in x)
    text = stated("mass = 0", "bandwidth = 0", "polar_inertia = nan", "suply_V = 24.0").replace(f"{weighed}\n", "")
    assert [*told(text)] == ["mass", "bandwidth", "polar_inertia", "suply_V"]
    (tmp_path / "stand.toml").write_text(text, encoding="utf-8")
    (tmp_path / "stand.dbc").write_text(DBC, encoding="cp1252")
    assert check_rig_file(str(tmp_path / "stand.toml")) == 2
    err = capsys.readouterr().err
    assert all(f": simulation.{key}: found " in err for key in ("mass", "bandwidth", "polar_inertia", "suply_V"))


def test_what_a_machine_can_just_be_is_taken() -> None:
    lines = ("slew = 0", "position_noise = 0", "current_noise = 0", "mode_1_on = 0", "unbalance = 0", "position_lsb = 0",
             "viscous = 0", "ki = 0")  # fmt: skip
    rig = RigFile.parse(stated(*lines), DBC, "stand.toml")
    assert draw(rig, 1).values["unbalance.vorn"] == 0.0


@pytest.mark.parametrize(
    ("name", "value", "found", "expected"),
    [
        ("supply_V", 0.0, "0 V", "more than 0 V"),
        ("current_limit", -1.0, "-1 A", "more than 0 A"),
        ("resistance", 0.0, "0 Ohm", "a positive number"),
        ("shaft.mass", -2.0, "-2 kg", "a positive number"),
        ("geometry.luftspalt", 0.0, "0 m", "a positive number"),
        ("beta.x_vorn", float("nan"), "nan", "a finite number"),
        ("hum", float("inf"), "inf", "a finite number"),
    ],
)
def test_no_truth_is_told_that_cannot_be(name: str, value: float, found: str, expected: str) -> None:
    rig = RigFile.parse(TEXT, DBC, "stand.toml")
    known = {n: draw_one(t, 1, n) for n, t in machine_of(rig).stated(rig).items()}
    assert name in {*known, *rig.simulation, "hum"}
    with pytest.raises(ConfigError) as caught:
        draw(rig, 1, {name: value})
    (p,) = caught.value.problems
    assert (p.key, p.found, p.expected) == (name, found, expected)


def test_names_that_begin_like_a_key_are_their_own() -> None:
    """A channel of a bias current, a probe called `mass`: zeros, gains and planted defects have any sign."""
    assert cannot_be("bias_front.offset", -0.01) is None
    assert cannot_be("bias.gain", -1.0) is None
    assert cannot_be("runout_phase_1.x", -3.0) is None
    assert cannot_be("bias_front", -0.01) == ("-0.01 A", "more than 0 A")
    rig = RigFile.parse(TEXT, DBC, "stand.toml")
    signs = {name: -1.0 for name in machine_of(rig).defects if name.startswith("probe_sign.")}
    assert signs
    assert draw(rig, 1, signs).defects.items() >= signs.items()
