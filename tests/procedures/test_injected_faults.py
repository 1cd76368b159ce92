"""The AMB calibration while its link or its controller fails: the trouble is named, nothing passes unsaid, and the rotor
comes to rest."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import pytest

from bench.cli.loading import load_procedure
from bench.cli.opening import simulated
from bench.link import fault_injection
from bench.link.fault_injection import Fault
from bench.progress import PlainProgress
from bench.record.outcomes import Outcome
from bench.record.records import FindingEntry
from bench.record.specs import load_spec
from bench.rigfile import RigFile, load_rig
from bench.run import runner
from bench.run.job import Job
from bench.run.runner import RunResult
from bench.run.supervisor import Supervisor
from sim_backend import endpoint
from sim_backend.machine import Truth

PLAN = {"settle_s": 0.2, "average_s": 0.1, "max_position_m": 5e-6, "max_drift_A": 0.1}  # sound, and quick
LIFTED, WATCHDOG_S, BEAT_S, LANDING_S = ("LIFTING", "LEVITATED", "SPINNING"), 0.08, 0.02, 1.0
SAFE = ("OFF", "FAULT")
CALIBRATION = load_procedure("amb-calibration")


class WatchedRig(endpoint.SimulatedRig):
    """A simulated rig that notes how long after its first fault the rotor is let down, and when it rests."""

    made: WatchedRig

    def __init__(
        self, rig: RigFile, truth: Truth, session: int = 1, given: tuple[Fault, ...] = (), substeps: int = 2,
        start_ns: int = endpoint.EPOCH_NS,
    ) -> None:  # fmt: skip
        super().__init__(rig, truth, session, given, substeps, start_ns)
        WatchedRig.made = self
        self.begin = self.now_ns() + round(given[0].start_s * 1e9)  # the host's first frame comes in the first slice
        self.down_s = self.rest_s = float("inf")

    def sleep(self, seconds: float) -> None:
        """In parts of 10 ms while it matters; how time is sliced changes no byte."""
        since = (self.now_ns() - self.begin) * 1e-9
        part = 0.01 if -0.1 < since < 0.2 else seconds
        for _ in range(round(seconds / part)):
            super().sleep(part)
            since, state = (self.now_ns() - self.begin) * 1e-9, self.device.state
            if since > 0 and state not in LIFTED:
                self.down_s = min(self.down_s, since)
                if state in SAFE:
                    self.rest_s = min(self.rest_s, since)


@dataclass(frozen=True)
class Case:
    """Faults, what the record must say of them, and within how many seconds of bench time the rotor goes down."""

    faults: str
    outcome: Outcome
    codes: tuple[str, ...]
    down_s: float | None = None  # None: the run goes on to its end
    reconnect_s: float = 0.0


AT_ONCE = WATCHDOG_S + BEAT_S
CASES = (
    Case("drop=0.02@12+2 corrupt=0.02@20+2", Outcome.INDETERMINATE,
         ("samples-lost", "step-incomplete", "missing-samples", "error-frames")),
    Case("duplicate=0.02@12+2 reorder=0.02@16+2 burst=0.3@20+2", Outcome.PASS,
         ("frames-duplicated", "frames-reordered", "telemetry-late")),
    # within the step from 12.05 s to 12.15 s, and shorter than the watchdog
    Case("disconnect@12.07+0.05 delay=0.3@20+2", Outcome.INDETERMINATE,
         ("link-reconnected", "step-incomplete", "telemetry-late"), None, 1.0),
    Case("stall@12+0.2", Outcome.ABORTED, ("controller-fault",), AT_ONCE),
    Case("stall@12", Outcome.ERROR, ("link-lost",), AT_ONCE),
    Case("disconnect@12", Outcome.ERROR, ("link-lost",), AT_ONCE),
    Case("bus-off@12", Outcome.ERROR, ("link-lost", "bus-off"), AT_ONCE),
    Case("mute@12", Outcome.ERROR, ("no-reply",), 10.0),
    Case("reboot@12", Outcome.ABORTED, ("controller-fault", "controller-restarted"), 0.0),
    Case("stuck-heartbeat@12", Outcome.ABORTED, ("controller-fault",), AT_ONCE),
)  # fmt: skip


@pytest.fixture(scope="module")
def rig() -> RigFile:
    return load_rig("tsbs12")


def parsed(case: Case) -> tuple[Fault, ...]:
    return tuple(fault_injection.parse(text) for text in case.faults.split())


def run(rig: RigFile, case: Case, out: Path, monkeypatch: pytest.MonkeyPatch) -> RunResult:
    monkeypatch.setattr(endpoint, "SimulatedRig", WatchedRig)
    name = rig.devices["controller"].link
    link = rig.links[name].model_copy(update={"reconnect_s": case.reconnect_s})
    used = rig.model_copy(update={"links": {**rig.links, name: link}})
    plan = CALIBRATION.plan.model_validate({**used.plans[CALIBRATION.name], **PLAN})
    job = Job(CALIBRATION, used, plan, load_spec(used.name, CALIBRATION.name), "sim", 3)
    connect = simulated(used, 3, {}, "auto", CALIBRATION.settings(used, plan), parsed(case))
    with Supervisor().watching() as supervisor:
        return runner.run(job, out, connect, supervisor, PlainProgress(io.StringIO()), None)


def find(result: RunResult, code: str) -> list[FindingEntry]:
    return [f for f in result.record.findings if f.code == code]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.faults)
def test_a_fault_is_named_and_the_rotor_comes_to_rest(
    case: Case, rig: RigFile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = run(rig, case, tmp_path, monkeypatch)
    assert result.outcome is case.outcome, result.reason
    assert all(text in find(result, "faults-injected")[0].text for text in case.faults.split())
    for code in case.codes:
        assert find(result, code), (code, result.record.findings)
    machine = WatchedRig.made
    if case.down_s is None:
        assert machine.device.state == "OFF"
        return
    for _ in range(30):  # the bench is gone: whatever comes now the controller does alone
        machine.sleep(0.1)
    assert machine.device.state in SAFE
    assert machine.down_s <= case.down_s + 0.01
    assert machine.rest_s <= machine.down_s + LANDING_S + 0.2


def test_every_kind_has_its_case() -> None:
    assert {fault.kind for case in CASES for fault in parsed(case)} == set(fault_injection.KINDS)
