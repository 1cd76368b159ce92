"""Names and units that are misspelt, one at a time, all through rig files: `bench check` names each, and nothing comes down."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from bench.cli.broken import forgiven
from bench.cli.check import check_rig_file
from bench.errors import ConfigError

ROOT = Path(__file__).parents[1]
STAND = ROOT / "examples" / "plain-stand" / "stand.toml"
FILES = (STAND, ROOT / "examples" / "vertical-spindle" / "spindle.toml", ROOT / "rigs" / "amb5dof.toml")
FREE = frozenset(("about", "source", "title", "model", "serial", "place", "name", "number", "date", "due", "laboratory", "id",
                  "near_end", "far_end", "zero_at", "unprotected", "encoding", "dbc", "url", "at", "no_fault"))  # fmt: skip
"""Keys of free text, and those whose file cannot be read at all."""
EACH = 2  # words of one key that are tried


def misspelt(word: str) -> str:
    """As a slip of the hand has it: the last two letters exchanged, or another last one."""
    if len(word) < 3 or word[-1] == word[-2]:
        return f"{word[:-1]}{'z' if word.endswith('q') else 'q'}"
    return f"{word[:-2]}{word[-1]}{word[-2]}"


def slips(text: str) -> Iterator[tuple[str, str, str]]:
    """Key, misspelt word and text of a rig file, for some words of every key that has words."""
    tried: dict[str, set[str]] = {}
    for found in re.finditer(r'"([^"\n]+)"', text):
        before = text[text.rfind("\n", 0, found.start()) + 1 : found.start()]
        keys = re.findall(r"([\w-]+)\s*=\s*(?:\[[^\]]*)?$", before)
        key = keys[-1] if keys else ""
        if not key or key.isdigit() or key in FREE or before.lstrip().startswith("#"):
            continue
        words = tried.setdefault(key, set())
        if found[1] not in words and len(words) < (4 * EACH if key in ("unit", "signal", "channel") else EACH):
            words.add(found[1])
            wrong = misspelt(found[1])
            yield key, wrong, f"{text[: found.start(1)]}{wrong}{text[found.end(1) :]}"


def written(folder: Path, of: Path, text: str) -> str:
    """A rig file with its DBC beside it."""
    for dbc in of.parent.glob("*.dbc"):
        if not (folder / dbc.name).exists():
            shutil.copy(dbc, folder)
    path = folder / of.name
    path.write_text(text, encoding="utf-8")
    return str(path)


def swapped(text: str, old: str, new: str) -> str:
    assert old in text, old
    return text.replace(old, new, 1)


@pytest.mark.parametrize("of", FILES, ids=lambda of: of.stem)
def test_every_misspelt_word_is_named(of: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    silent = []
    for key, wrong, text in slips(of.read_text(encoding="utf-8")):
        status = check_rig_file(written(tmp_path, of, text))
        out, err = capsys.readouterr()
        if wrong.rpartition(".")[2].lstrip("-") not in out + err or (
            status == 0 and key in ("unit", "signal", "channel")
        ):
            silent.append(f"{key}: {wrong}")
    assert not silent


@pytest.mark.parametrize("of", FILES, ids=lambda of: of.stem)
def test_as_it_is_shipped_a_rig_file_has_no_problems(of: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert check_rig_file(str(of)) == 0
    assert "no problems" in capsys.readouterr().out


SIGNAL = 'LageXVorn = { signal = "StandLage.LageXVorn", unit = "m"'
RANGE = 'sensor_range = { channel = "Messbereich" }'
PLACE = '[bearings.vorn]\nkind = "radial"\nat = { value = 130, unit = '
HANDED = [
    ("channels.LageXVorn.unit", "mn", [(SIGNAL, SIGNAL.replace('unit = "m"', 'unit = "mn"'))]),
    ("channels.LageXVorn.signal", "LageXVonr", [(SIGNAL, SIGNAL.replace(".LageXVorn", ".LageXVonr")), (RANGE, "")]),
    ("bearings.vorn.at.unit", "mn", [(f'{PLACE}"mm"', f'{PLACE}"mn"')]),
    ("devices.controller.link", "reglre", [('link = "regler"', 'link = "reglre"')]),
]
"""What once ended `bench check`: a unit, a signal of a probe whose range is judged from its readings, a place, a link."""


@pytest.mark.parametrize(("key", "wrong", "changes"), HANDED)
def test_what_follows_from_a_slip_ends_nothing(
    key: str, wrong: str, changes: list[tuple[str, str]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = STAND.read_text(encoding="utf-8")
    for old, new in changes:
        text = swapped(text, old, new)
    text = swapped(text, "supply_V = 24.0", "suply_V = 24.0")
    assert check_rig_file(written(tmp_path, STAND, text)) == 2
    told = capsys.readouterr().err
    assert re.search(rf": {re.escape(key)}: found \S*{wrong}", told)
    assert key.startswith(("bearings", "devices")) or "simulation.suply_V" in told


PROBLEMS = [
    ("supply_V = 24.0", "suply_V = 24.0", "simulation.suply_V", "did you mean supply_V?"),
    ("supply_V = 24.0", "beta_x_vonr = 1e-6", "simulation.beta_x_vonr", "did you mean beta_x_vorn?"),
    ("supply_V = 24.0", "supply_V = { vorn = 24.0 }", "simulation.supply_V", "one number"),
    ("supply_V = 24.0", "kp = { x_vonr = 1e4 }", "simulation.kp.x_vonr", "did you mean x_vorn?"),
    ("supply_V = 24.0", "bias = { vron = 1.0 }", "simulation.bias.vron", "did you mean vorn?"),
    ('AlterPult = "host_age"', 'AlterPutl = "host_age"', "simulation.readings.AlterPutl", "did you mean AlterPult?"),
    ('AlterPult = "host_age"', 'AlterPult = "host_aeg"', "simulation.readings.AlterPult", "host_age"),
]


@pytest.mark.parametrize(("old", "new", "key", "expected"), PROBLEMS)
def test_a_twin_names_the_keys_that_it_does_not_know(
    old: str, new: str, key: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, STAND, swapped(STAND.read_text(encoding="utf-8"), old, new))
    assert check_rig_file(path) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if f": {key}: found " in line]
    assert len(lines) == 1
    assert expected in lines[0]


EVERY = """
mass = 1
transverse_inertia = 1
tilt = 0
amplifier_hz = 500
bias_vorn = 1.0
kp = { x_vorn = 1e4 }
ki_x_vorn = 1e4
kd = 20
bandwidth = 30
derivative_hz = 1000
notch_q = 1
lift_time = 1
lift_time_s = 1
watchdog_s = 0.2
landing_speed = 5
slew = 1
slew_tilt = 1
position_lsb = 1e-9
current_lsb = 1e-4
mode_1_on = 0
mode_1 = 900
trip_current = 10
trip_speed = 100
runout_1 = 1e-6
runout_phase = 0.1
ring_friction = 0.2
stop = 1e-4
"""


def test_a_twin_takes_every_key_of_its_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = swapped(STAND.read_text(encoding="utf-8"), "supply_V = 24.0", f"supply_V = 24.0{EVERY}")
    check_rig_file(written(tmp_path, STAND, text))
    assert "simulation." not in capsys.readouterr().err
    page = (ROOT / "docs" / "reference" / "twin.md").read_text(encoding="utf-8")
    table = page.partition("| `mass` |")[2].partition("\n\n")[0]
    rows = [re.findall(r"`(\w+)`", line.split("|")[1]) for line in table.splitlines()[1:]]
    keys = [key for row in rows for key in row if f"\n{key} = " not in text and key != "runout_4"]
    stated = "".join(f"{key} = 1\n" for key in keys)
    check_rig_file(written(tmp_path, STAND, swapped(text, "supply_V = 24.0", f"supply_V = 24.0\n{stated}")))
    assert "no use for" not in capsys.readouterr().err


def of_stand(text: str) -> Iterator[tuple[str, str, str, str]]:
    """What can never work: a changed text, the key at fault, found and expected."""
    name = re.findall(r'contact = \{ (\w+) = \{ channel = "(\w+)"', text)[0]
    contact = f'{name[0]} = {{ channel = "{name[1]}"'
    yield (swapped(text, contact, f"{contact}, mask = 1024"), f"capabilities.status.contact.{name[0]}.mask", "1024",
           "at most")  # fmt: skip
    sensor = re.findall(r"^\[sensors\]\n(?:#.*\n)*(\w+) = ", text, re.M)[0]
    wrong = misspelt(sensor)
    yield swapped(text, f"\n{sensor} = {{ gain", f"\n{wrong} = {{ gain"), f"sensors.{wrong}", wrong, f"such as {sensor}"
    parameter = re.findall(r"^\[parameters\]\n(?:#.*\n)*(\w+) = ", text, re.M)[0]
    settings = (
        f"\n[capabilities.settings.law]\nhard = {{ {parameter} = 1.0, Hubzeit = 1.0 }}\nsoft = {{ Hubzeit = 2.0 }}\n"
    )
    place = "\n[plans.amb-calibration]"
    yield swapped(text, place, settings + place), "capabilities.settings.law.soft", f"no {parameter}", "every parameter"


@pytest.mark.parametrize("which", range(3))
def test_what_can_never_work_is_refused(which: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text, key, found, expected = list(of_stand(STAND.read_text(encoding="utf-8")))[which]
    assert check_rig_file(written(tmp_path, STAND, text)) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if f": {key}: found " in line]
    assert len(lines) == 1
    assert found in lines[0]
    assert expected in lines[0]


def test_a_mistake_of_ours_comes_out_where_the_rig_file_has_none() -> None:
    with pytest.raises(KeyError), forgiven(()):
        raise KeyError("x")
    with forgiven(("a problem",)):
        raise ConfigError("x")
