"""The stranger `tung`, as a second laboratory wrote it: 35 kg, 70 degrees up, four probes in each plane, axes that look 45
degrees apart, masses over pulleys, Swedish names, a sample each 4 ms.
What went wrong with it, in silence or without a word why."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from bench.cli.abilities import abilities
from bench.cli.virtual import Simulated, simulated_run
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.rigfile.check import check_rig
from bench.rigfile.check_capture import problems_of
from bench.uncertainty import interval

STRANGERS = Path(__file__).resolve().parent / "strangers"
RIG = STRANGERS / "tung.toml"
RUNOUT = 'runout = { value = 0, unit = "um", u = 2.4, distribution = "normal", source = "mätt" }\n'
QUICK = {"angles": 1, "settle_s": 0.6, "average_s": 0.4}


def changed(folder: Path, *edits: tuple[str, str]) -> str:
    """A copy of the file with other text."""
    text = RIG.read_text(encoding="utf-8")
    for old, new in edits:
        assert old in text
        text = text.replace(old, new, 1)
    shutil.copy(RIG.with_suffix(".dbc"), folder)
    (folder / RIG.name).write_text(text, encoding="utf-8")
    return str(folder / RIG.name)


def told(path: str) -> list[str]:
    return [str(problem).partition(": ")[2] for problem in check_rig(path)[0]]


def codes(run: Simulated, *, notes: bool = False) -> list[str]:
    return [f.code for f in run.results if isinstance(f, Finding) and (f.effect is Effect.NOTE) is notes]


def off(run: Simulated, *names: str) -> dict[str, float]:
    """Errors in U of the quantities that have a truth."""
    found = {
        f"{m.quantity.name}@{m.where}": m for m in run.results if isinstance(m, Measured) and m.quantity.name in names
    }
    return {k: (m.estimate.value - run.truth[k]) / interval(m.estimate).U for k, m in found.items() if k in run.truth}


def test_a_name_may_begin_with_any_letter() -> None:
    """`övre` was refused: a letter from A to Z."""
    assert told(str(RIG)) == []
    rig = load_rig(str(RIG))
    assert "övre" in rig.bearings
    assert {a.procedure for a in abilities(rig) if a.able} == {"amb-calibration", "bearing-model", "step", "tracking"}


@pytest.mark.parametrize("name", ["1a", "_a", "a b", "-a", ""])
def test_a_name_begins_with_a_letter(tmp_path: Path, name: str) -> None:
    edited = changed(tmp_path, ("[hooks.krokA]", f'[hooks."{name}"]'))
    assert any("a name: a letter, then letters, digits, _ or -" in line for line in told(edited))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("tick_s = 0.00025", 'tick_s = "0.00025"', "devices.controller.tick_s: found '0.00025'; expected a valid number"),
        ("max_current_A = 13", "max_current_A = true", "envelope.max_current_A: found True; expected a valid number"),
        ("mass = { value = 35", "mass = { value = true", "shaft.mass.value: found True; expected a valid number"),
        ("half_width = 0.012", "half_width = 0.7", "bearings.undre.gap: found 0.0006 ± 0.0007 m; expected a tolerance"),
        ("friction = { value = 0.004", "friction = { value = 1.2", "hooks.krokA.pulley.friction: found 1.2; expected 0 to 1"),
        ("friction = { value = 0.004", "friction = { value = -0.3", "hooks.krokA.pulley.friction: found -0.3; expected 0 to 1"),
        ("pull = ", 'along = "far"\npull = ', "hooks.krokA.along: found 'far' beside a pull to the side; expected one of both"),
    ],
)  # fmt: skip
def test_what_was_taken_in_silence_is_told(tmp_path: Path, old: str, new: str, said: str) -> None:
    """`true` was 1 A, a pulley took 1.2 of the weight so that masses pulled the other way."""
    assert any(line.startswith(said) for line in told(changed(tmp_path, (old, new))))


def test_a_pulley_turns_no_pull_that_goes_down(tmp_path: Path) -> None:
    lines = RIG.read_text(encoding="utf-8").splitlines()
    pull = next(line for line in lines if line.startswith("pull = "))
    assert any(
        line.startswith("hooks.krokA.pulley: found one on a hook that pulls down")
        for line in told(changed(tmp_path, (pull, "")))
    )


def test_messages_of_captures_have_their_signals_and_names() -> None:
    """Without value tables a run ended by a KeyError, and the check had said nothing."""
    rig = load_rig(str(STRANGERS / "ventil.toml"))
    assert rig.capture is not None
    assert list(problems_of(rig.capture, rig.messages)) == []
    arm = rig.messages["CaptureArm"]
    bare = replace(arm, signals=tuple(replace(s, choices={}) for s in arm.signals if s.name != "level"))
    found = list(
        problems_of(rig.capture, replace(rig.messages, messages={**rig.messages.messages, "CaptureArm": bare}))
    )
    assert [(key, what) for key, what, _ in found] == [
        ("capture", "message CaptureArm without level"),
        ("capture: CaptureArm.trigger", "no value named NOW"),
    ]


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1])
def test_noise_beside_a_small_load_is_no_misfit(tmp_path: Path, seed: int) -> None:
    """Axis uB carries 5 N beside 56: half a per cent of them is 24 mN, and the noise of a position 19 mN."""
    run = simulated_run("bearing-model", str(RIG), seed, {}, tmp_path / "run.mcap")
    assert codes(run) == []
    assert "runout-untold" not in codes(run, notes=True)
    assert max(map(abs, off(run, "beta", "offset", "K_i", "K_x").values())) < 1.5


@pytest.mark.long
def test_a_runout_that_the_file_does_not_tell_is_missing_from_offsets(tmp_path: Path) -> None:
    """Offsets were 2.2 U off, and nothing said so."""
    path = changed(tmp_path, (RUNOUT, ""))
    run = simulated_run("bearing-model", path, 1, {}, tmp_path / "run.mcap")
    assert "runout-untold" in codes(run, notes=True)
    assert max(map(abs, off(run, "offset").values())) > 1.8


@pytest.mark.long
def test_masses_pull_to_two_sides(tmp_path: Path) -> None:
    run = simulated_run("amb-calibration", str(RIG), 2, QUICK, tmp_path / "run.mcap")
    assert codes(run) == []
    assert len(off(run, "K")) == 4
    assert max(map(abs, off(run, "K", "Kw").values())) < 1.2
