"""A controller whose clock runs at another rate than the rig file states ends a run within seconds of the host's time."""

from __future__ import annotations

import pytest
from host_clock import RIG, HostClock

from bench.errors import ClockWrong
from bench.link.frames import FrameBatch
from bench.link.session import Session
from drivers.controller import Controller


class Host(HostClock):
    """The machine's clock runs `rate` times as fast."""

    def __init__(self, rate: float) -> None:
        super().__init__()
        self.rate, self.begun = rate, self._now

    def sleep(self, seconds: float) -> None:
        self._now += round(seconds * 1e9)
        self.machine.sleep(max(0.0, self.rate * (self._now - self.begun) - (self.machine.now_ns() - self.begun)) * 1e-9)

    def receive(self) -> FrameBatch:
        batch = self.machine.link.receive().copy()
        batch["t_ns"] = self.begun + ((batch["t_ns"] - self.begun) / self.rate).astype("int64")
        return batch


def connected(rate: float) -> tuple[Host, Controller]:
    """A controller that does not say that it is a simulated one."""
    host = Host(rate)
    controller = Controller(RIG, host, host, Session(1, 1_767_225_600, "test"))
    controller.connect()
    controller.watch.simulated = False
    return host, controller


@pytest.mark.parametrize(("rate", "within_s"), [(0.5, 6.0), (0.98, 6.0), (1.02, 11.0), (2.0, 11.0)])
def test_a_clock_of_another_rate_ends_the_run(rate: float, within_s: float) -> None:
    host, controller = connected(rate)
    with pytest.raises(ClockWrong, match=f"runs at {rate:.3f} of the rate that the rig file states.*tick_s"):
        controller.clock.sleep(15.0)
    assert (host.now_ns() - host.begun) * 1e-9 < within_s


def test_a_simulated_controller_on_a_slow_computer_ends_none() -> None:
    """It is told in the end: the computer may give it the rest of the time yet."""
    _, controller = connected(0.9)
    controller.watch.simulated = True
    controller.clock.sleep(15.0)
    drift = controller.telemetry.host.drift()
    assert drift is not None
    assert drift.ppm == pytest.approx(-1e5, rel=0.2) or drift.ppm == pytest.approx(1.1e5, rel=0.2)


@pytest.mark.parametrize("rate", [0.9997, 1.0, 1.0003])
def test_a_clock_that_is_right_ends_none(rate: float) -> None:
    _, controller = connected(rate)
    controller.clock.sleep(12.0)
    assert controller.telemetry.host.unknown_s == 0.0


def test_make_safe_does_not_mind_a_wrong_clock() -> None:
    _, controller = connected(0.5)
    with pytest.raises(ClockWrong):
        controller.clock.sleep(15.0)
    controller.guarded = False
    controller.clock.sleep(1.0)
