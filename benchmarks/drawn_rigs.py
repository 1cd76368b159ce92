"""Rig files as other laboratories might write them: an example's with a machine of another shape, drawn by number.

    python -m benchmarks.drawn_rigs spindle runs/drawn --first 0 --count 10
    python -m benchmarks.sound runs/drawn.jsonl --count 1 $(printf -- '--rig %s ' runs/drawn/*.toml)

Mass, inertias, centre of mass, the places of bearings and probes (those of one plane apart as well), the angles of the axes, of
each bearing by itself, right-handed or left-handed or oblique, and the magnets' strength are others; the spindle leans as well.
Names, messages and tolerances are the example's. From LOOPS on a spindle's gains, noise, unbalance and runout are others too,
and some tell no loop delay. Some of them `bench check` refuses, and some fly with no room left: what is
looked for is a value that is off in silence.
"""

from __future__ import annotations

import argparse
import random
import re
import shutil
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1] / "examples"
EXAMPLES = {"spindle": ROOT / "vertical-spindle/spindle.toml", "stand": ROOT / "plain-stand/stand.toml"}
Text = str
LOOPS = 1000  # the first number whose spindles have loops of their own


def main() -> None:
    """Write them, and print where."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("example", choices=[*EXAMPLES])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=10)
    asked = parser.parse_args()
    for number in range(asked.first, asked.first + asked.count):
        print(write(asked.example, number, asked.folder))


def write(example: str, number: int, folder: Path) -> Path:
    """A rig file in a folder, with the example's DBC beside."""
    folder.mkdir(parents=True, exist_ok=True)
    for dbc in EXAMPLES[example].parent.glob("*.dbc"):
        shutil.copy(dbc, folder)
    path = folder / f"{example}{number}.toml"
    path.write_text(drawn(example, number), encoding="utf-8")
    return path


def drawn(example: str, number: int) -> Text:
    """The text of a rig file."""
    text = EXAMPLES[example].read_text(encoding="utf-8")
    text = re.sub(r'^name = ".*"', f'name = "{example}{number}"', text, count=1, flags=re.MULTILINE)
    draw = random.Random(number)
    if example == "stand":
        return _stand(text, draw)
    return _loops(_spindle(text, draw), draw) if number >= LOOPS else _spindle(text, draw)


def _spindle(text: Text, r: random.Random) -> Text:
    tilt, heavy = r.choice([0, 15, 40, 70, 90, 90]), r.uniform(0.5, 1.6)
    if tilt < 90:
        text = re.sub(r"^zero_at = .*\n", "", text, flags=re.MULTILINE)  # directions are from above then
    text = _put(text, "tilt = ", tilt)
    text = _put(text, "mass = ", 4.6 * heavy)
    text = _put(text, "polar_inertia = ", 5.2e-3 * heavy * r.uniform(0.6, 1.5))
    text = _put(text, "transverse_inertia = ", 0.048 * heavy * r.uniform(0.6, 1.3))
    text = _put(text, "centre_of_mass = ", 205 + r.uniform(-80, 80))
    text = _bearings(
        text, r, ("lower", 95 + r.uniform(-15, 25), "LowU"), ("upper", 330 + r.uniform(-25, 15), "UppU"), 90
    )
    for probe, at in (("LowU", 60), ("LowV", 0), ("UppU", 362), ("UppV", 0)):
        text = _put(text, f"{probe} = {{ channel", at + r.uniform(-12, 10))
    return _put(text, "beta = ", 6.6e-7 * heavy * r.uniform(0.8, 1.5))


def _loops(text: Text, r: random.Random) -> Text:
    for bearing in ("Lower", "Upper"):
        for gain, few, most in (("Kp", 0.8, 1.4), ("Ki", 0.15, 1.2), ("Kd", 0.6, 1.5)):
            text = _scaled(text, f"{gain}{bearing} = ", "default", r.uniform(few, most))
    loud = {"Disp": 10 ** r.uniform(-0.5, 0.8), "Coil": 10 ** r.uniform(-0.5, 0.5)}
    for channels, factor in loud.items():
        text = re.sub(rf"^({channels}\w+ = .*noise = )([^,}} ]+)", lambda m, f=factor: f"{m[1]}{float(m[2]) * f:.4g}", text,
                      flags=re.MULTILINE)  # fmt: skip
    text = re.sub(r"^position_noise = .*", f"position_noise = {1e-7 * loud['Disp']:.4g}", text, flags=re.MULTILINE)
    text = re.sub(r"^current_noise = .*", f"current_noise = {2e-3 * loud['Coil']:.4g}", text, flags=re.MULTILINE)
    text = _scaled(text, "runout = ", "u", r.uniform(0.3, 3))
    heavy = 10 ** r.uniform(-0.7, 0.5)
    text = _scaled(_scaled(text, "unbalance = ", "value", heavy), "unbalance = ", "half_width", heavy)
    return re.sub(r"^loop_delay = .*\n", "", text, flags=re.MULTILINE) if r.random() < 0.3 else text


def _stand(text: Text, r: random.Random) -> Text:
    heavy = r.uniform(0.4, 2.0)
    text = _put(text, "mass = ", 3.2 * heavy)
    text = _put(text, "transverse_inertia = ", 0.05 * heavy * r.uniform(0.5, 1.3))
    text = _bearings(text, r, ("vorn", 130 + r.uniform(-15, 12), "y_vorn"), ("hinten", None, "y_hinten"), -90)
    for probe, at in (("y_vorn", 98), ("x_vorn", 98), ("y_hinten", -122), ("x_hinten", -122)):
        text = _put(text, f"{probe} = {{ channel", at + r.uniform(-20, 20))
    return _put(text, "beta = ", 1.4e-6 * heavy * r.uniform(0.7, 1.4))


def _bearings(
    text: Text, r: random.Random, near: tuple[str, float, str], far: tuple[str, float | None, str], usual: int
) -> Text:
    """Both bearings at their places, with their first axes' angles; the second axes from these, alike in both."""
    angle = r.choice([0.0, 30.0, 45.0, r.uniform(0, 360)])
    turned, apart = (
        r.choice([0.0, 0.0, 0.0, 45.0, r.uniform(-40, 40)]),
        r.choice([90, 90, -90, round(r.uniform(70, 110), 2)]),
    )

    def of(at: float | None, axis: str, direction: float) -> Callable[[Text], Text]:
        def change(part: Text) -> Text:
            part = part if at is None else _put(part, "at = ", at)
            part = _put(part, f"axes.{axis} = ", direction % 360)
            return part.replace(f"plus_deg = {usual}", f"plus_deg = {apart}")

        return change

    text = _section(text, near[0], of(near[1], near[2], angle))
    return _section(text, far[0], of(far[1], far[2], angle + turned))


def _section(text: Text, bearing: str, change: Callable[[Text], Text]) -> Text:
    start = text.index(f"[bearings.{bearing}]")
    end = text.index("\n[", start + 1)
    return text[:start] + change(text[start:end]) + text[end:]


def _scaled(text: Text, line: str, key: str, factor: float) -> Text:
    """The first line that begins so with `key` times as much."""
    found, count = re.subn(rf"^({re.escape(line)}.*?\b{key} = )([^,}} ]+)", lambda m: f"{m[1]}{float(m[2]) * factor:.6g}",
                           text, count=1, flags=re.MULTILINE)  # fmt: skip
    if not count:
        raise SystemExit(f"found no line {line!r} with {key}")
    return found


def _put(text: Text, line: str, value: float) -> Text:
    """Another first `value` in the line that begins so."""
    pattern = rf"^({re.escape(line)}.*?value = )[^,}} ]+"
    found, count = re.subn(pattern, lambda m: f"{m[1]}{value:.9g}", text, count=1, flags=re.MULTILINE)
    if not count:
        raise SystemExit(f"found no line {line!r} with a value")
    return found


if __name__ == "__main__":
    main()
