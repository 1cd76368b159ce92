"""What a rig's telemetry can show of time is said where its procedures are listed."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.cli.__main__ import main
from bench.cli.sampled import told
from bench.rigfile import load_rig

TESTS = Path(__file__).resolve().parents[1]
GEMISCHT = str(TESTS / "strangers/gemischt.toml")
SAID = (
    "telemetry every 2 ms and no capture of positions and currents: nothing is told\n"
    "  above 200 Hz, nor of a step that rises in less than 4 ms\n"
)


@pytest.mark.parametrize("command", [("list", "--rig", GEMISCHT), ("check", GEMISCHT, "step"), ("check", GEMISCHT)])
def test_slow_telemetry_is_told_before_a_run(command: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    """`step` ends there with telemetry-too-slow: its rise of 3.2 ms has 1.6 samples."""
    assert main(command) == 0
    assert capsys.readouterr().out.endswith(SAID)


def test_nothing_is_said_where_the_controller_captures() -> None:
    assert told(load_rig("amb5dof")) == ""
    assert told(load_rig(str(TESTS.parent / "examples/plain-stand/stand.toml"))) == ""
