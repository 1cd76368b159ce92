"""The live page in a browser, on a server that speaks its protocol with a made run."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

import pytest
import standin as made
from shaft import channels
from standin import Standin

Open = Callable[..., Any]
COUNTED = """
window.drawn = []; document.addEventListener("drawn",
  ({ detail }) => window.drawn.push([performance.now(), Date.now() - detail.sent_ms + detail.age_ms]));
"""
INKED = """(canvas) => { const c = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  const seen = new Set();
  for (let k = 0; k < c.length; k += 4) if (c[k + 3]) seen.add((c[k] << 16) | (c[k + 1] << 8) | c[k + 2]);
  return seen.size; }"""


def told_of(frames: list[list[float]]) -> str:
    """Frames a second and ages of [ms when drawn, age in ms]."""
    seconds = (frames[-1][0] - frames[0][0]) / 1000
    ages = sorted(age for _, age in frames)
    return (
        f"{len(frames) / seconds:.1f} frames/s over {seconds:.1f} s, age p50 {ages[len(ages) // 2]:.0f} ms, "
        f"p99 {ages[int(0.99 * len(ages))]:.0f} ms, {100 * sum(a < 250 for a in ages) / len(ages):.2f} % under 250 ms"
    )


def test_it_asks_for_nothing_beyond_its_own_server_and_complains_of_nothing(
    standin: Standin, opened: Open, expect: Any
) -> None:
    made.begin(standin.run)
    page = opened(standin.address)
    expect(page.page.locator("#state")).to_have_text("LEVITATED")
    assert {urlsplit(url).netloc for url in page.asked} == {f"127.0.0.1:{standin.server_port}"}
    assert {urlsplit(url).path for url in page.asked} >= {"/", "/app.js", "/app.css", "/uplot.iife.min.js", "/events"}
    assert page.wrong == []


def test_the_token_leaves_the_address_and_a_reload_finds_it(standin: Standin, opened: Open, expect: Any) -> None:
    made.begin(standin.run)
    page = opened(standin.address)
    expect(page.page.locator("#state")).to_have_text("LEVITATED")
    assert made.TOKEN not in page.page.url
    page.page.reload()
    expect(page.page.locator("#state")).to_have_text("LEVITATED")
    assert not any(made.TOKEN in url for url in page.asked)


def test_a_wrong_token_is_said_and_the_right_one_in_the_same_tab_taken(
    standin: Standin, opened: Open, expect: Any
) -> None:
    made.begin(standin.run)
    page = opened(standin.address.replace(made.TOKEN, "another"))
    expect(page.page.locator("#link")).to_contain_text("Open the address that the run printed")
    asked = len(page.asked)
    expect(page.page.locator("body")).to_have_attribute("data-link", "refused")
    page.page.wait_for_timeout(1500)
    assert len(page.asked) == asked  # what is refused is not asked for again
    page.page.goto(standin.address)  # nothing but the fragment differs: no reload
    expect(page.page.locator("#state")).to_have_text("LEVITATED")


def test_an_address_without_a_token_asks_for_nothing_of_the_run(standin: Standin, opened: Open, expect: Any) -> None:
    page = opened(standin.address.partition("#")[0])
    expect(page.page.locator("#link")).to_contain_text("no token")
    assert not any("/events" in url for url in page.asked)


def test_thirty_channels_are_drawn_with_their_orbits(
    standin: Standin, opened: Open, expect: Any, figure: Callable[[str], None]
) -> None:
    made.begin(standin.run)
    page = opened(standin.address, height=3400, script=COUNTED)
    page.page.get_by_role("tab", name="All").click()
    names = [c["name"] for c in channels() if c["kind"] != "state"]
    assert len(names) == 30
    expect(page.page.locator(".legend li")).to_have_count(30)
    page.page.wait_for_timeout(6000)
    frames = page.page.evaluate("window.drawn")
    shown = " ".join(page.page.locator(".legend li").all_inner_texts())
    assert all(re.search(rf"{name} −?\d", shown) for name in names)
    plots, orbits = page.page.locator(".frame canvas"), page.page.locator(".orbit canvas")
    assert orbits.count() == 2
    assert all(plots.nth(k).evaluate(INKED) > 10 for k in range(plots.count()))
    assert all(orbits.nth(k).evaluate(INKED) > 10 for k in range(2))
    figure(f"made run, 30 channels in one window of 1200 x 3400: {told_of(frames)}")
    assert len(frames) > 10


def test_units_and_limits_are_those_that_people_are_told(standin: Standin, opened: Open, expect: Any) -> None:
    made.begin(standin.run)
    page = opened(standin.address)
    expect(page.page.locator(".plot figcaption").first).to_have_text("inboard · positions / µmlimit ±150")
    page.page.get_by_role("tab", name="Machine").click()
    legend = page.page.locator(".legend").filter(has_text="temp_i")
    expect(legend).to_contain_text(re.compile(r"temp_i \d.*°C"))  # once the first reading is there
    assert 26 < float(re.search(r"temp_i (\d+\.?\d*)", legend.inner_text())[1]) < 29  # 300 K; type: ignore[index]
    assert "limit 79.85" in page.text("figure:has-text('temperatures') figcaption")
    expect(page.page.locator("#speed")).to_have_text("430 r/min")


def test_a_lost_connection_is_grey_and_said_and_comes_back(standin: Standin, opened: Open, expect: Any) -> None:
    made.begin(standin.run)
    standin.run.tell("finding", made.FINDINGS[0])
    page = opened(standin.address)
    expect(page.page.locator(".finding")).to_have_count(1)
    standin.run.refuses = 503
    standin.run.drop()
    expect(page.page.locator("#link")).to_contain_text("Connection lost")
    expect(page.page.locator("body")).to_contain_class("stale")
    expect(page.page.locator("#stopsays")).to_contain_text("may not get through")
    assert float(page.page.locator(".view").evaluate("(v) => getComputedStyle(v).opacity")) < 0.5
    standin.run.refuses = 0
    expect(page.page.locator("body")).to_have_attribute("data-link", "live")
    expect(page.page.locator("body")).not_to_contain_class("stale")
    expect(page.page.locator(".finding")).to_have_count(1)  # what stands came again, and is there once
    expect(page.page.locator("#stopsays")).to_contain_text("no emergency stop")


def test_plots_that_stand_still_are_said_to_be_old_while_the_connection_stands(
    standin: Standin, opened: Open, expect: Any
) -> None:
    made.begin(standin.run)
    page = opened(standin.address)
    expect(page.page.locator("#state")).to_have_text("LEVITATED")
    standin.run.silent = True
    expect(page.page.locator("#old")).to_contain_text("the plots stand still")
    expect(page.page.locator("body")).to_contain_class("stale")
    assert page.page.locator("body").get_attribute("data-link") == "live"


def test_findings_stand_by_effect_and_the_log_in_order(standin: Standin, opened: Open, expect: Any) -> None:
    made.begin(standin.run)
    for finding in made.FINDINGS:
        standin.run.tell("finding", finding)
    page = opened(standin.address)
    expect(page.page.locator(".finding code")).to_have_text(
        ["stuck-channel", "load-not-still", "calibration-due", "missing-samples"]
    )
    expect(page.page.locator("#loglist li")).to_have_text(list(made.LOG))


def test_the_end_has_results_with_their_uncertainty_and_the_report(standin: Standin, opened: Open, expect: Any) -> None:
    made.begin(standin.run)
    page = opened(standin.address)
    standin.run.tell("end", made.end("PASS", 0, "all quantities within their limits"))
    expect(page.page.locator("#results tbody tr")).to_have_count(4)
    rows = [row.split() for row in page.page.locator("#results tbody tr").all_inner_texts()]
    assert rows[0] == ["K", "(inboard)", "75.00", "0.21", "N/A", "PASS"]
    assert rows[2] == ["i_0", "(inboard)", "0.0123", "0.0031", "A", "–"]
    assert rows[3] == ["runout", "(inboard)", "4.21", "0.21", "µm", "PASS"]
    with page.page.expect_popup() as popup:
        page.page.click("#reportlink")
    expect(popup.value.locator("h1")).to_have_text("The report")
    asked = len(page.asked)
    standin.run.drop()
    page.page.wait_for_timeout(1500)
    assert len(page.asked) == asked  # the run is over: a server that is gone is no lost connection
    assert page.page.locator("#link").is_hidden()


HOSTILE = '<img src=x onerror="window.bad=1"><b>bold</b>'


def test_text_of_the_run_is_text(standin: Standin, opened: Open, expect: Any) -> None:
    run = standin.run
    made.begin(run, title=HOSTILE, rig=HOSTILE, procedure=HOSTILE, run_id=HOSTILE)
    run.tell("progress", {**made.PROGRESS, "stage": HOSTILE, "step": HOSTILE})
    run.tell("log", {"text": HOSTILE})
    run.tell("finding", {"code": HOSTILE, "text": HOSTILE, "where": HOSTILE, "effect": HOSTILE})
    run.tell(
        "prompt",
        {**made.PROMPT, "question": HOSTILE, "hint": HOSTILE, "choices": [{"label": HOSTILE, "answer": HOSTILE}]},
    )
    page = opened(standin.address)
    expect(page.page.locator("#question")).to_have_text(HOSTILE)
    run.tell("answered", {"id": 1, "answer": HOSTILE, "by": HOSTILE})
    result = {**made.RESULTS[0], "name": HOSTILE, "unit": HOSTILE, "verdict": HOSTILE}
    run.tell("end", {**made.end("PASS", 0, HOSTILE), "outcome": HOSTILE, "results": [result], "folder": HOSTILE})
    expect(page.page.locator("#outcome")).to_have_text(HOSTILE)
    assert page.page.locator("img").count() == 0
    assert page.page.locator("b").filter(has_text="bold").count() == 0
    assert page.page.evaluate("window.bad") is None
    assert [w for w in page.wrong if "favicon" not in w] == []


def test_another_run_at_the_same_address_begins_anew(standin: Standin, opened: Open, expect: Any) -> None:
    made.begin(standin.run)
    page = opened(standin.address)
    page.page.click("#stop")
    expect(page.page.locator("#stop")).to_have_text("STOPPING")
    standin.run.told.clear()
    made.begin(standin.run, run_id="another", title="Another run")
    standin.run.drop()
    expect(page.page.locator("#title")).to_have_text("Another run")
    expect(page.page.locator("#stop")).to_have_text("STOP")
    expect(page.page.locator("#stop")).to_be_enabled()


@pytest.mark.parametrize("width", [400, 1200])
def test_everything_is_reached_by_the_keyboard(standin: Standin, opened: Open, expect: Any, width: int) -> None:
    made.begin(standin.run)
    standin.run.tell("prompt", made.PROMPT)
    page = opened(standin.address, width=width)
    expect(page.page.locator("#prompt")).to_be_focused()
    seen = set()
    for _ in range(20):
        page.page.keyboard.press("Tab")
        seen.add(page.page.evaluate("document.activeElement.id || document.activeElement.textContent.trim()"))
    assert seen >= {"It hangs still", "answer", "Send", "window", "hold", "zoom", "who", "stop", "inboard", "loglist"}
    page.page.get_by_role("tab", name="inboard").focus()
    page.page.keyboard.press("ArrowRight")
    expect(page.page.get_by_role("tab", name="outboard")).to_have_attribute("aria-selected", "true")
    expect(page.page.locator(".plot figcaption").first).to_contain_text("outboard")


def test_held_plots_say_so_and_go_on(standin: Standin, opened: Open, expect: Any) -> None:
    made.begin(standin.run)
    page = opened(standin.address)
    expect(page.page.locator("#state")).to_have_text("LEVITATED")
    page.page.click("#hold")
    expect(page.page.locator("#hold")).to_have_text("Held: go on")
    still = page.page.locator(".frame canvas").first.evaluate("(c) => c.toDataURL()")
    page.page.wait_for_timeout(500)
    assert page.page.locator(".frame canvas").first.evaluate("(c) => c.toDataURL()") == still
    page.page.click("#hold")
    page.page.wait_for_timeout(500)
    assert page.page.locator(".frame canvas").first.evaluate("(c) => c.toDataURL()") != still
