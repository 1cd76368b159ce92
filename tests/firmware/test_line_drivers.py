"""The bench's own drivers against the C controller with a command line, on TCP and on a pseudo terminal, in two dialects."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from line_programs import (
    ENVIRONMENT,
    KINDS,
    MACHINE,
    NOISE_A,
    PATIENT_MS,
    PLACES,
    TICKS_S,
    Controller,
    controller,
    law,
    opened,
    rise_time,
    run_bench,
)

from bench.errors import BenchError, LinkError
from bench.rigfile.capture import rises

STEP_A = 5.0
SIXTEEN = ("i_q_R1", "i_d_R1", "i_q_R2", "u_dc", "z",
           *(f"i_s{k}" for k in range(1, 7)), *(f"i_f{k}" for k in range(1, 6)))  # fmt: skip
HOLDING = """
import sys, time
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import line_programs
with line_programs.opened(Path(sys.argv[2]), sys.argv[3], sys.argv[4]) as rig:
    rig.levitation.enable()
    rig.levitation.levitate()
    print("held", flush=True)
    rig.clock.sleep(60.0)
"""


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(params=PLACES)
def place(request: pytest.FixtureRequest) -> str:
    return str(request.param)


REST = [("lira", "pty"), ("north", "tcp")]
each_on_one = pytest.mark.parametrize(
    ("kind", "place"), [("lira", "tcp"), ("north", "pty"), *(pytest.param(*x, marks=pytest.mark.long) for x in REST)]
)
"""Both dialects and both kinds of link, all four of them in the long run only."""


def crossing(y: np.ndarray[Any, Any], level: float) -> float:
    """Samples from the first to where the level is first reached, between two on a straight line."""
    k = int(np.argmax(y >= level))
    return float(k - 1 + (level - y[k - 1]) / (y[k] - y[k - 1]))


def test_a_run(line_program: Path, rig_folder: Path, kind: str, place: str) -> None:
    with controller(line_program, place, kind, PATIENT_MS) as there, opened(rig_folder, kind, there.url) as rig:
        c = rig.levitation
        c.enable()
        assert c.mode == "READY"
        assert c.get("kp.b") == 680000
        c.set("kp.b", 7e5)
        assert c.get("kp.b") == 7e5
        with pytest.raises(BenchError, match=r"kp\.b"):
            c.set("kp.b", 3e6)
        c.levitate()
        assert c.mode == "LEVITATED"
        assert c.reading("z") == pytest.approx(8e-3, abs=10e-6)
        c.set("ref_z", 6e-3)
        rig.clock.sleep(0.1)  # 2 mm at half a metre a second
        assert c.reading("z") == pytest.approx(6e-3, abs=10e-6)
        c.land()
        assert c.mode == "READY"
        c.disable()
        assert c.mode == "OFF"
        health = rig.health()
    n = health.counters
    assert (n.lost, n.duplicates, n.reordered, n.wrong_length, n.unknown, n.reboots) == (0, 0, 0, 0, 0, 0)
    assert health.stats.crc_errors == 0


@each_on_one
def test_a_step_of_a_current(line_program: Path, rig_folder: Path, kind: str, place: str) -> None:
    """16 channels at 280 kHz about the step: the law in closed form, sample by sample, and its rise time."""
    with controller(line_program, place, kind, PATIENT_MS) as there, opened(rig_folder, kind, there.url) as rig:
        rig.levitation.enable()
        assert rig.capture is not None
        rig.capture.arm(SIXTEEN, seconds=0.02, before_s=0.005, trigger=rises("i_q_R1", STEP_A / 2))
        rig.clock.sleep(0.05)
        rig.levitation.set("step_q_R1", STEP_A)
        rig.capture.wait(5.0)
        data = rig.capture.upload()
        rig.levitation.set("step_q_R1", 0.0)
        rig.levitation.disable()
    now = {name: np.asarray(v) for name, v in data.columns.items()}
    y = now["i_q_R1"]
    assert sorted(now) == sorted(SIXTEEN)
    assert len(y) == 5600
    assert data.rate_hz == pytest.approx(TICKS_S)
    measured = (crossing(y, 0.9 * STEP_A) - crossing(y, 0.1 * STEP_A)) / TICKS_S
    assert measured == pytest.approx(rise_time(), rel=0.02)
    at, n = round(crossing(y, 0.5 * STEP_A)), np.arange(5600)
    assert abs(at - 1400) <= 1  # the trigger
    left = [np.std(y - STEP_A * law((n - k) / TICKS_S)) for k in range(at - 30, at)]
    assert min(left) == pytest.approx(NOISE_A, rel=0.05)  # nothing but noise is left of it, from one tick on
    assert sorted(left)[1] > 2 * NOISE_A
    settled = {name: float(np.mean(v[2800:])) for name, v in now.items()}
    assert [settled[x] for x in ("i_d_R1", "i_q_R2", "z")] == pytest.approx([0, 0, 0], abs=1e-3)
    assert settled["u_dc"] == pytest.approx(400, abs=0.05)
    phases = np.arange(6) * np.pi / 3
    assert [settled[f"i_s{k}"] for k in range(1, 7)] == pytest.approx(list(-STEP_A * np.sin(phases)), abs=2e-3)
    assert [settled[f"i_f{k}"] for k in range(1, 6)] == pytest.approx(list(-STEP_A * np.sin(phases[:5])), abs=2e-3)


def test_everything_at_once(line_program: Path, rig_folder: Path, kind: str) -> None:
    """All 64 channels at 35 kHz while telemetry goes on."""
    with controller(line_program, "tcp", kind, PATIENT_MS) as there, opened(rig_folder, kind, there.url) as rig:
        assert rig.capture is not None
        rig.capture.arm(rig.capture.channels, seconds=0.2, rate_hz=35_000)
        rig.capture.wait(5.0)
        data = rig.capture.upload()
        counters = rig.health().counters
    assert len(data.columns) == 64
    assert {len(v) for v in data.columns.values()} == {7000}
    assert (counters.lost, counters.gaps) == (0, 0)


def killed_under_the_bench(there: Controller, rig_folder: Path) -> None:
    with opened(rig_folder, "lira", there.url) as rig:
        rig.levitation.enable()
        there.process.kill()
        rig.clock.sleep(3.0)
        raise AssertionError("nothing was noticed")


def test_a_killed_controller_is_noticed(line_program: Path, rig_folder: Path, place: str) -> None:
    with controller(line_program, place, watchdog_ms=PATIENT_MS) as there:
        said = rf"port {re.escape(there.where)} was unplugged or its other end closed"
        with pytest.raises(LinkError, match=said):
            killed_under_the_bench(there, rig_folder)


@each_on_one
def test_a_killed_bench_leaves_a_controller_that_lands(
    line_program: Path, rig_folder: Path, kind: str, place: str
) -> None:
    """A machine so busy that a bench misses 80 ms before it is killed is none to tell by: again, with another program."""
    for _ in range(5):
        with controller(line_program, place, kind) as there:
            words = (str(Path(__file__).parent), str(rig_folder), kind, there.url)
            with subprocess.Popen([sys.executable, "-c", HOLDING, *words], stdout=subprocess.PIPE, text=True) as bench:
                assert bench.stdout
                held = bench.stdout.readline().strip()
                bench.send_signal(signal.SIGKILL)
                killed = time.monotonic()
            _, beat, _, lost, state = there.said().split()
            after = time.monotonic() - killed
            landed = there.said().split()
        if held == "held":
            break
    assert state == "LEVITATED"
    assert 0.08 <= (int(lost) - int(beat)) / TICKS_S <= 0.1
    assert after < 0.5  # by this machine's clock, as busy as it is: no process of the bench goes on
    assert landed[0::2] == ["landed", "FAULT"]
    assert 0.3 <= (int(landed[1]) - int(lost)) / TICKS_S < 0.31


def test_a_streaming_controller_is_listened_to(line_program: Path, rig_folder: Path, kind: str) -> None:
    """It goes on when its bench has gone; who listens says nothing."""
    with controller(line_program, "tcp", kind) as there:
        with opened(rig_folder, kind, there.url) as rig:
            assert rig.levitation.mode == "OFF"
        words = ("listen", kind, "--seconds", "2", "--link", f"controller={there.url}")
        done = run_bench(rig_folder, *words)
    assert done.returncode == 0
    assert re.search(r"samples +\d+ at \d+/s, by the DBC 500/s; lost 0 in 0 gaps", done.stdout)


def run(kind: str, url: str, seconds: float) -> tuple[str, ...]:
    given = ("run", "line-look", "--rig", kind, "--backend", "live", "--operator", "console", "--no-report")
    return (*given, "--link", f"controller={url}", "--plan", f"seconds={seconds}")


@each_on_one
def test_a_whole_run(line_program: Path, rig_folder: Path, kind: str, place: str) -> None:
    with controller(line_program, place, kind, PATIENT_MS) as there:
        done = run_bench(rig_folder, *run(kind, there.url, 0.5))
    assert done.returncode == 0, done.stderr
    record = json.loads((rig_folder / done.stdout.strip() / "record.json").read_text())
    assert record["outcome"] == "DONE"
    assert {f["code"] for f in record["findings"]} <= MACHINE


def test_a_controller_killed_in_a_run(line_program: Path, rig_folder: Path, kind: str) -> None:
    """The link's loss, and that nobody knows where the mover is, stand in the record; the bench ends by itself."""
    with controller(line_program, "tcp", kind, PATIENT_MS) as there:
        words = [sys.executable, "-m", "line_catalogue", *run(kind, there.url, 30)]
        with subprocess.Popen(
            words, cwd=rig_folder, env=ENVIRONMENT, text=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        ) as child:  # fmt: skip
            assert child.stderr
            while child.stderr.readline() != "held\n":
                assert child.poll() is None
            there.process.kill()
            out, told = child.communicate(timeout=60)
    assert child.returncode == 3
    record = json.loads((rig_folder / out.strip() / "record.json").read_text())
    assert record["outcome"] == "ERROR"
    codes = [f["code"] for f in record["findings"]]
    assert codes[0] == "link-lost"
    assert "make-safe-failed" in codes
    assert "was unplugged or its other end closed" in told
