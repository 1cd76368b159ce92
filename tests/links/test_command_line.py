"""A command line over real ports: a served rig as a process of its own, on a pty and over TCP, with a good and a bad line."""

from __future__ import annotations

import re
import signal
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import lira_line
import numpy as np
import processes
import pytest

from bench.link.codec import Decoder
from bench.rigfile import RigFile, load_rig
from drivers.controller import Controller
from drivers.reception import open_reception

FULL = ("current-step", "coil-map", "loop-response", "emf-constant")
"""What the current loops matter to; the reduced model has none, and no voltages."""
PORTS = ("--link", "controller=cli:socket://127.0.0.1:0", "--link", "operator=line:127.0.0.1:0")
KINDS = ("cli:socket", "cli:pty")
WIRE_S = 52 * 2 * 17_500 * 10 / 3e6  # of half a second of 52 channels at 35 kHz, at 3 MBd
LEVITATED = 4  # as the firmware numbers its states
FAULTS = ("--fault", "corrupt=0.01", "--fault", "drop=0.01")


def connected(folder: Path, url: str) -> AbstractContextManager[Controller]:
    return lira_line.connected((folder / "rigs/lira.toml").read_text(), url)


@pytest.mark.timeout(240)
@pytest.mark.parametrize("faults", [(), FAULTS], ids=["good", "bad"])
def test_half_a_second_of_every_measurement_comes_whole(tmp_path: Path, faults: tuple[str, ...]) -> None:
    """Every sample is there, whatever the line did to its blocks."""
    with processes.served(tmp_path, "--seed", "1", "--truth", "reduced=1", *faults, rig="lira", ports=PORTS) as rig:
        for kind in KINDS:
            with connected(tmp_path, rig.endpoints[kind]) as controller:
                controller.enable()
                controller.levitate()
                capture = controller.capture
                assert capture is not None
                capture.arm(capture.channels[:52], seconds=0.5, rate_hz=35_000)
                capture.wait(60.0)
                begun = time.monotonic()
                data = capture.upload()
                took = time.monotonic() - begun
                sys.stderr.write(f"{kind} {' '.join(faults)}: {took:.2f} s; the wire alone takes {WIRE_S:.2f} s\n")
                controller.land()
                controller.disable()
            assert len(data.columns) == 52
            assert {len(x) for x in data.columns.values()} == {17_500}
            assert np.ptp(data.columns["z"]) < 1e-4


@pytest.mark.timeout(180)
def test_a_host_that_dies_is_landed(tmp_path: Path) -> None:
    """Within 100 ms of the last heartbeat by the device: a second client hears how old it says that is."""
    arguments = ("run", "mission", "--rig", "lira", "--backend", "live", "--no-report", "--plan", "repeats=20")
    with processes.served(tmp_path, "--truth", "reduced=1", rig="lira", patience_s=0.08, ports=PORTS) as rig:
        with processes.real_bench(tmp_path, *arguments, *rig.links("cli:socket")) as host:
            rig.child.wait_for("LEVITATED")
            heard = listening(tmp_path, rig.endpoints["cli:socket"])
            host.process.send_signal(signal.SIGKILL)
            line = rig.child.wait_for("LANDING")
            assert "HEARTBEAT_LOST" in line
            rig.child.wait_for("-> FAULT")
        oldest = max(age for state, age in heard() if state == LEVITATED)
    assert 0.07 < oldest <= 0.1


def listening(folder: Path, url: str) -> Callable[[], list[tuple[float, float]]]:
    """Hear the telemetry that others asked for; gives the state and the age of the heartbeat of each sample."""
    text = re.sub(r'url = "cli:.*"', f'url = "{url}"', (folder / "rigs/lira.toml").read_text())
    rig = RigFile.parse(text, load_rig("lira").dbc_text)
    reception = open_reception(rig.link, "controller", time.time_ns, rig=rig)
    reception.read(0.1)

    def told() -> list[tuple[float, float]]:
        batches = [reception.read(0.1) for _ in range(200)]
        decoded, _ = Decoder(rig.messages["Telemetry"]).decode(np.concatenate(batches))
        reception.close()
        return list(zip(decoded["state"].tolist(), decoded["host_age"].tolist(), strict=True))

    return told


@pytest.mark.long
@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    ("rig_name", "procedure", "plan"),
    [("lira-200v", "current-step", ("repeats=4", "small_repeats=4")),
     ("lira", "mission", ("repeats=2", "spare_s=0.5")),
     ("lira", "loop-response", ("axes=['z', 'gamma']", "lines=5", "refined=5")),
     ("lira", "coil-map", ("repeats=2",)),
     ("lira", "encoder-zero", ("motors=['LA']", "repeats=3", "trial_rad=0")),
     ("lira", "unstable-pole", ("shots=20",)),
     ("lira", "sensor-delay", ("lines=3", "record_s=0.3")),
     ("lira", "gate-margin", ("places_m=[0.008]", "angles_rad=[-1.5, 1.5]")),
     ("lira", "pull-ratio", ("levels_m=[-2e-5, 0.0, 2e-5]", "settle_s=0.6")),  # by the host's clock: the rig may be behind
     ("lira", "actuator-constant", ('loops="along"', "lines=5", "pairs=3")),
     ("lira", "emf-constant", ("motors=['LA']",))],
)  # fmt: skip
def test_procedures_over_the_command_line(tmp_path: Path, rig_name: str, procedure: str, plan: tuple[str, ...]) -> None:
    """Each against a served rig, as processes: what is measured holds what the machine was drawn with."""
    arguments = tuple(x for one in plan for x in ("--plan", one))
    reduced = int(procedure not in FULL)
    with processes.served(tmp_path, "--seed", "3", "--truth", f"reduced={reduced}", rig=rig_name, ports=PORTS) as rig:
        with processes.real_bench(
            tmp_path, "run", procedure, "--rig", rig_name, "--backend", "live", "--operator", "auto", "--no-report",
            *rig.links("cli:socket"), *arguments,
        ) as host:  # fmt: skip
            status = host.end(800.0)
            record = processes.record_in(tmp_path, host)
    assert status == 0, record["findings"]
    assert record["measurements"]
    assert record["link"]["gaps"] == 0
