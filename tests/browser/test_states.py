"""Every state of the page at the width of a desk and of a phone, light and dark: a picture of each to look at, under
`build/browser/`. What is held here: nothing is wider than the window, and STOP is within reach as long as the run goes on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import standin as made
from standin import Run, Standin

SHOTS = Path(__file__).resolve().parents[2] / "build" / "browser"
FITS = "document.documentElement.scrollWidth <= document.documentElement.clientWidth"
REACHED = """() => { const { left, right, top, bottom } = document.getElementById("stop").getBoundingClientRect();
  const at = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
  return at?.id === "stop" && bottom <= innerHeight && right <= innerWidth && bottom - top >= 44; }"""


def connecting(run: Run, page: Any) -> str:
    run.holds = True
    page.reload()
    return "#link:has-text('Connecting')"


def preparing(run: Run, page: Any) -> str:
    return "#link:has-text('Connected')"


def running(run: Run, page: Any) -> str:
    made.begin(run)
    return "#state:has-text('LEVITATED')"


def prompt(run: Run, page: Any) -> str:
    made.begin(run)
    run.tell("prompt", made.PROMPT)
    return "#prompt:visible"


def finding(run: Run, page: Any) -> str:
    made.begin(run)
    for one in made.FINDINGS:
        run.tell("finding", one)
    return ".finding.error"


def stopping(run: Run, page: Any) -> str:
    made.begin(run)
    page.locator("#state:has-text('LEVITATED')").wait_for()
    page.click("#stop")
    return "#stop:has-text('STOPPING')"


def passed(run: Run, page: Any) -> str:
    made.begin(run)
    page.locator("#state:has-text('LEVITATED')").wait_for()
    run.tell("end", made.end("PASS", 0, "all quantities within their limits"))
    return "#outcome:has-text('PASS')"


def aborted(run: Run, page: Any) -> str:
    made.begin(run)
    page.locator("#state:has-text('LEVITATED')").wait_for()
    run.tell("end", made.end("ABORTED", 4, "operator-stop: STOP by page: Ann"))
    return "#outcome:has-text('ABORTED')"


def lost(run: Run, page: Any) -> str:
    made.begin(run)
    page.locator("#state:has-text('LEVITATED')").wait_for()
    run.refuses = 503
    run.drop()
    return "body.stale"


BEFORE_AND_AFTER = (connecting, preparing, passed, aborted)


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize(("width", "height"), [(1200, 900), (400, 800)], ids=["1200", "400"])
@pytest.mark.parametrize("state", [connecting, preparing, running, prompt, finding, stopping, passed, aborted, lost])
def test_a_state(standin: Standin, opened: Callable[..., Any], state: Callable[[Run, Any], str], width: int, height: int,
                 dark: bool) -> None:  # fmt: skip
    standin.run.began -= 41.0  # a while ago: plots are full
    page = opened(standin.address, width=width, height=height, dark=dark).page
    page.locator(state(standin.run, page)).first.wait_for()
    page.wait_for_timeout(1500)
    assert page.evaluate(FITS)
    assert state in BEFORE_AND_AFTER or page.evaluate(REACHED)
    SHOTS.mkdir(parents=True, exist_ok=True)
    name = f"{state.__name__}-{width}-{'dark' if dark else 'light'}"
    (SHOTS / f"{name}.png").write_bytes(page.screenshot())
    if width == 400:  # all of it, which a phone shows by scrolling
        page.set_viewport_size({"width": width, "height": 2200})
        page.wait_for_timeout(500)
        (SHOTS / f"{name}-all.png").write_bytes(page.screenshot())
