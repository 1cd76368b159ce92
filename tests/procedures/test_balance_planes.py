"""Of three balancing planes a plan names the two in which weights are fixed."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.errors import ConfigError
from bench.findings import Effect, Finding
from bench.procedure import Measured
from bench.rigfile import load_rig
from bench.rigfile.check import check_rig
from bench.uncertainty import interval
from procedures.balance import fitting
from procedures.balance.plan import Plan
from procedures.balance.planes import chosen, names_of

INCLINE = Path(__file__).resolve().parents[1] / "strangers/incline.toml"


def with_a_third(folder: Path) -> str:
    """A fan with a plane more at its rear bearing, in which the twin has an unbalance too."""
    text = INCLINE.read_text(encoding="utf-8")
    begin = text.index("[balancing.hub]")
    hub = text[begin : text.index("\n[", begin) + 1]
    tail = hub.replace("balancing.hub", "balancing.tail").replace("value = -150,", "value = -250,")
    assert tail != hub
    path = folder / INCLINE.name
    path.write_text(text.replace(hub, hub + tail), encoding="utf-8")
    shutil.copy(INCLINE.with_suffix(".dbc"), folder)
    return str(path)


@pytest.mark.parametrize(
    ("planes", "told"),
    [
        ((), 'found none; expected the two of fan, hub, tail in which weights are fixed, such as planes = ["tail", "fan"]'),
        (("fan",), "planes: found fan; expected two of fan, hub, tail"),
        (("fan", "fan"), "planes: found fan, fan; expected two of fan, hub, tail"),
        (("fan", "disc"), "planes: found fan, disc; expected two of fan, hub, tail"),
        (("hub", "tail"), "takes planes on both sides of it"),
    ],
)  # fmt: skip
def test_two_of_three_are_named(tmp_path: Path, planes: tuple[str, ...], told: str) -> None:
    path = with_a_third(tmp_path)
    assert check_rig(path)[0] == ()
    (line,) = fitting.of_plan(load_rig(path), Plan(planes=planes))
    assert told in line
    with pytest.raises(ConfigError, match="planes"):
        simulated_run("balance", path, 1, {"planes": planes}, tmp_path / "run.mcap")


def test_two_of_two_need_not_be_named(tmp_path: Path) -> None:
    rig = load_rig(str(INCLINE))
    assert names_of(rig) == ("hub", "fan")  # the nearest to the near end first, whatever the order of the plan
    assert names_of(chosen(rig, ("fan", "hub"))) == names_of(rig)
    assert names_of(chosen(load_rig(with_a_third(tmp_path)), ("fan", "tail"))) == ("tail", "fan")


def test_a_shaft_is_balanced_in_two_of_three(tmp_path: Path) -> None:
    """What the third plane has on it counts as so much in the two; the operator is told these alone."""
    run = simulated_run("balance", with_a_third(tmp_path), 9, {"planes": ("fan", "tail")}, tmp_path / "run.mcap")
    assert [f.code for f in run.results if isinstance(f, Finding) and f.effect is not Effect.NOTE] == []
    fixed = {e["plane"] for e in run.recording.events("operator") if e["action"] == "attach"}
    assert fixed == {"fan", "tail"}
    told = {f"{m.quantity.name}@{m.where}": m.estimate for m in run.results if isinstance(m, Measured)}
    off = {k: (told[k].value - true) / interval(told[k]).U for k, true in truth_of_motion(run).items() if k in told}
    assert {k.partition("@")[2] for k in off} == {"fan", "tail"}
    assert len(off) == 8
    assert max(map(abs, off.values())) < 1.5
