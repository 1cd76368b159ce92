"""A controller whose clock runs at another rate than the rig file states: the run ends within seconds, and says the rate."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_mischief_drivers import called, controller_that, levitated

from bench.errors import ClockWrong
from drivers.controller import Controller

SECONDS = 60.0  # of which a few pass: it ends as soon as the rate is known


def kept_levitated(c: Controller) -> None:
    levitated(c)
    c.clock.sleep(SECONDS)


@pytest.mark.long
@pytest.mark.timeout(120)
@pytest.mark.parametrize(
    ("ppm", "rate"), [(20_000, "1.020"), (1_000_000, "2.000"), (-20_000, "0.980"), (-500_000, "0.500")]
)
def test_a_clock_of_another_rate_ends_the_run(mischief: Path, ppm: int, rate: str) -> None:
    with controller_that(mischief, f"ppm={ppm}") as c:
        with pytest.raises(ClockWrong) as caught:
            kept_levitated(c)
    code, text = called(caught.value)
    assert code == "clock-drift"
    assert text.startswith(f"the controller's clock runs at {rate} of the rate that the rig file states")
    assert "tick_s in the rig file" in text
