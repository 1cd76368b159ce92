"""Steps that the controller's messages do not hold as asked: they are what was sent; far from it they are refused."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from bench.cli.motion_truth import truth_of_motion
from bench.cli.virtual import simulated_run
from bench.procedure import Measured
from bench.rigfile import RigFile, load_rig
from bench.uncertainty import interval
from procedures.step.held import asked_over_sent, grain, sent
from procedures.step.plan import Plan
from procedures.step.procedure import check

STAND = Path(__file__).resolve().parents[2] / "examples/plain-stand"


def coarse(folder: Path, scale: str) -> RigFile:
    """The stand, whose controller takes set points as multiples of another length, in micrometres."""
    text = (STAND / "stand.toml").read_text(encoding="utf-8")
    (folder / "stand.toml").write_text(text, encoding="utf-8")
    for path in STAND.glob("*.dbc"):
        dbc = path.read_bytes().decode("cp1252")
        changed, times = re.subn(r"(SG_ Soll\w+ [^(]*)\([^,]+,0\) \[[^]]*\]", rf"\1({scale},0) [0|0]", dbc)
        assert times == 4
        (folder / path.name).write_bytes(changed.encode("cp1252"))
    return load_rig(str(folder / "stand.toml"))


def test_what_is_sent_is_the_nearest_that_a_signal_holds(tmp_path: Path) -> None:
    """By hand: 10 um by 0.3 um are 33 of them, 20 um 67; at 45 degrees 10 um are 7.0711 um, which one
    bearing's signals hold as 7.07 um."""
    rig = load_rig(str(STAND / "stand.toml"))
    assert grain(rig, "SollYVorn") == pytest.approx(1e-8)
    assert sent(rig, "y", 1.0024e-5) == pytest.approx(1.002e-5)
    assert asked_over_sent(rig, "y", 0.0, 1.0024e-5) == pytest.approx(1.0024 / 1.002)
    assert asked_over_sent(rig, "y", 0.0, 2e-5) == 1.0
    coarser = coarse(tmp_path, "0.3")
    assert sent(coarser, "z", 1e-5) == pytest.approx(9.9e-6)
    assert sent(coarser, "y", 2e-5) == pytest.approx(2.01e-5)
    turned = load_rig(str(STAND.parents[1] / "tests/strangers/gemischt.toml"))
    assert sent(turned, "y", 1e-5) == pytest.approx((7.07e-6 + 7.071068e-6) / math.sqrt(2), rel=1e-6)


def test_sizes_that_cannot_nearly_be_sent_are_refused(tmp_path: Path) -> None:
    assert list(check(load_rig(str(STAND / "stand.toml")), Plan(sizes_m=(1.0005e-5, 2e-5)))) == []
    found = list(check(coarse(tmp_path, "0.3"), Plan(axes=("y",), sizes_m=(1e-6, 2e-5))))
    assert len(found) == 1
    assert found[0].startswith("sizes_m: found 1 um along y, which is sent as 0.9 um")
    assert "SollYVorn 0.3 um" in found[0]


def test_settling_is_in_the_band_about_what_was_sent(tmp_path: Path) -> None:
    """10.005 um, sent as 10 um, settled 7 U beside the truth in the band about 10.005 um."""
    plan = {"axes": ["y"], "sizes_m": [1.0005e-5, 2e-5], "settle_s": 1.0}
    run = simulated_run("step", str(STAND / "stand.toml"), 1, plan, tmp_path / "s.mcap")
    true = truth_of_motion(run)
    times = [m for m in run.results if isinstance(m, Measured) and m.quantity.name == "settling_time"]
    assert len(times) == 4
    for m in times:
        assert abs(m.estimate.value - true[f"settling_time@{m.where}"]) < 1.2 * interval(m.estimate).U, m.where
