"""What a rig file says twice, or cannot mean: refused by place, found, expected."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.rigfile.check import check_rig

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
