"""A rig file of a foreign controller is enough to simulate it: in one process, and served over its own DBC."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import processes
import pytest
from bound_rigs import OWN, plain_text, written

from bench.cli.virtual import simulated_run
from bench.procedure import Measured
from bench.recording import Recording

QUICK = {"settle_s": 0.15, "average_s": 0.12}


@pytest.mark.long
@pytest.mark.timeout(300)
def test_a_calibration_finds_the_constants_that_it_finds_on_the_machines_own_map(tmp_path: Path) -> None:
    rigs = ("tsbs12", written(tmp_path))
    runs = [simulated_run("amb-calibration", rig, 1, QUICK, tmp_path / f"{k}.mcap") for k, rig in enumerate(rigs)]
    native, bound = ({m.quantity.name: m for m in run.results if isinstance(m, Measured)} for run in runs)
    assert set(bound) == set(native)
    for name, ours in bound.items():
        truth = runs[1].truth[name]
        assert abs(ours.estimate.value - truth) < 3 * ours.estimate.u, name
        assert ours.estimate.u == pytest.approx(native[name].estimate.u, rel=0.2), name


@pytest.mark.long
@pytest.mark.timeout(120)
@pytest.mark.parametrize("port", ["slcan:socket", "serial:socket"])
def test_a_served_rig_of_its_own_dbc_is_levitated_by_the_bench(tmp_path: Path, port: str) -> None:
    (tmp_path / "rigs").mkdir()
    # a test machine that gives its processes no time for seconds is no dead host
    text = plain_text().replace("[simulation]\n", f"[simulation]\nwatchdog_s = {processes.PATIENCE_S}\n", 1)
    text = re.sub(r"i_z_p = .*", 'supply = { signal = "AmbRest.IZ_pos", unit = "V" }', text)
    dbc = (OWN / "plainamb.dbc").read_text(encoding="utf-8")
    written(tmp_path / "rigs", text, re.sub(r'(IZ_pos : 4\|15@1-) \(1,0\) (.*) "mA"', r'\1 (0.01,0) \2 "V"', dbc))
    ports = ("--link", "controller=slcan:socket://127.0.0.1:0", "--link", "operator=line:127.0.0.1:0")
    with processes.served(tmp_path, rig="plainamb", patience_s=None, ports=ports) as rig:
        status, record = processes.run(tmp_path, rig, port, "tiny-levitated", "--no-report", name="plainamb")
        states = [line.partition(": ")[2] for line in rig.state_lines()]
    assert (status, record["outcome"]) == (0, "DONE"), record["findings"]
    assert "simulated-controller" in [f["code"] for f in record["findings"]]  # by no message of its DBC
    assert record["link"]["errors"] == record["link"]["gaps"] == 0
    assert states[:3] == ["OFF -> READY", "READY -> LIFTING", "LIFTING -> LEVITATED"]
    assert states[-1].endswith("-> OFF")
    (path,) = (tmp_path / "runs").glob("*/recording.mcap")
    recording: Recording[object] = Recording.open(path)
    frames = np.concatenate(list(recording.frames("controller")))
    assert {int(i) for i in np.unique(frames["id"])} >= {32, 128, 144, 145, 146, 147}
