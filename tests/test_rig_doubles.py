"""What a rig file says twice, or cannot mean: refused by place, found, expected."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from bench.cli.virtual import simulated_run
from bench.procedure import Measured
from bench.rigfile.check import check_rig

RIG = Path(__file__).resolve().parents[1] / "rigs/amb5dof.toml"
FOLDER = Path(__file__).resolve().parent / "strangers"
STIFF, EMPTY = "Styv = { karaktar = 1 }", "Mjuk = { karaktar = 0 }\nStyv = { karaktar = 1 }\n"
INERTIA, MASS = "polar_inertia = { value = 0.16,", "mass = { value = 23,"


@pytest.mark.parametrize(
    ("old", "new", "place", "found", "expected"),
    [
        (STIFF, "Styv = { karaktar = 0 }", "settings.law.Styv", "settings.law.Mjuk", "values of its own"),
        (EMPTY, "", "settings.law", "no names", "what can be chosen"),
        (INERTIA, f'{INERTIA} id = "shaft/mass",', "shaft.polar_inertia.id", "'shaft/mass'", "shaft.mass"),
        (MASS, f'tilt = {{ value = 300, unit = "deg", half_width = 1, distribution = "rectangular", source = "x" }}\n{MASS}',
         "shaft.tilt.value", "300°", "-90 to 90°"),
    ],
)  # fmt: skip
def test_what_is_there_twice_or_cannot_be_is_refused(
    tmp_path: Path, old: str, new: str, place: str, found: str, expected: str
) -> None:
    text = (FOLDER / "skivrotor.toml").read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "skivrotor.toml").write_text(text.replace(old, new), encoding="utf-8")
    (tmp_path / "skivrotor.dbc").write_bytes((FOLDER / "skivrotor.dbc").read_bytes())
    (problem,) = check_rig(str(tmp_path / "skivrotor.toml"))[0]
    told = str(problem)
    assert place in told
    assert found in told
    assert expected in told


def test_a_missing_counter_is_told_by_the_key_that_names_it(tmp_path: Path) -> None:
    text = (FOLDER / "skivrotor.toml").read_text(encoding="utf-8")
    assert 'counter = "raknare"\n' in text
    (tmp_path / "skivrotor.toml").write_text(text.replace('counter = "raknare"\n', ""), encoding="utf-8")
    (tmp_path / "skivrotor.dbc").write_bytes((FOLDER / "skivrotor.dbc").read_bytes())
    (problem,) = check_rig(str(tmp_path / "skivrotor.toml"))[0]
    assert "`devices.controller.binding.counter` set" in str(problem)


def test_an_identifier_that_is_there_twice_is_told_once(tmp_path: Path) -> None:
    messages = "".join(f'BO_ 130 {name}: 8 C\n SG_ s : 0|8@1+ (1,0) [0|255] "" H\n\n' for name in ("One", "Two"))
    (tmp_path / "twice.dbc").write_text(f'VERSION ""\n\nBU_: C H\n\n{messages}', encoding="utf-8")
    code = "import sys; from pathlib import Path; from bench.rigfile.messages import load_messages; "
    code += "load_messages(Path(sys.argv[1]).read_text(encoding='utf-8'))"
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "twice.dbc")], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_a_twin_tells_the_map_that_its_rig_file_expects(tmp_path: Path) -> None:
    text = RIG.read_text(encoding="utf-8")
    assert "map_version = 2" in text
    path = tmp_path / RIG.name
    path.write_text(text.replace("map_version = 2", "map_version = 7"), encoding="utf-8")
    shutil.copy(RIG.with_suffix(".dbc"), tmp_path)
    run = simulated_run(
        "bearing-model", str(path), 0, {"spacing_m": 40e-6, "radius_m": 80e-6, "average_s": 0.2}, tmp_path / "s.mcap"
    )
    assert any(isinstance(r, Measured) for r in run.results)
