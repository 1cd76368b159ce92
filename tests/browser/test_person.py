"""What a person does at the live page: answers, and STOP."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import standin as made
from standin import Standin

Open = Callable[..., Any]


def test_a_question_is_shown_line_by_line_and_answered_by_name(standin: Standin, opened: Open, expect: Any) -> None:
    made.begin(standin.run)
    page = opened(standin.address)
    page.page.fill("#who", "Ann")
    standin.run.tell("prompt", made.PROMPT)
    expect(page.page.locator("#prompt")).to_be_visible()
    assert page.text("#question").splitlines() == made.PROMPT["question"].splitlines()
    assert page.page.title().startswith("?")
    page.page.get_by_role("button", name="It hangs still").click()
    expect(page.page.locator("#prompt")).to_be_hidden()
    expect(page.page.locator("#answered")).to_have_text("Answered: done (Ann).")
    assert standin.run.answers == [{"id": 1, "answer": "", "by": "Ann"}]
    standin.run.tell("prompt", {**made.PROMPT, "id": 2})
    page.page.fill("#answer", "M2")
    page.page.keyboard.press("Enter")
    expect(page.page.locator("#answered")).to_have_text("Answered: “M2” (Ann).")
    assert standin.run.answers[1] == {"id": 2, "answer": "M2", "by": "Ann"}
    assert standin.run.stops == []


def test_what_is_being_typed_stays_over_a_lost_connection(standin: Standin, opened: Open, expect: Any) -> None:
    made.begin(standin.run)
    standin.run.tell("prompt", made.PROMPT)
    page = opened(standin.address)
    page.page.fill("#answer", "was M")
    standin.run.drop()
    expect(page.page.locator("body")).to_have_attribute("data-link", "lost")
    expect(page.page.locator("body")).to_have_attribute("data-link", "live")
    expect(page.page.locator("#answer")).to_have_value("was M")
    expect(page.page.locator("#answer")).to_be_focused()


def test_an_answer_that_somebody_else_gave_first_is_said(standin: Standin, opened: Open, expect: Any) -> None:
    made.begin(standin.run)
    standin.run.tell("prompt", made.PROMPT)
    page = opened(standin.address)
    standin.run.answers.append({"id": 1, "answer": "", "by": "console"})
    page.page.get_by_role("button", name="It hangs still").click()
    expect(page.page.locator("#refused")).to_have_text("It was answered already by console.")
    standin.run.tell("answered", standin.run.answers[0])
    expect(page.page.locator("#answered")).to_have_text("Answered: done (console).")


def test_stop_is_sent_once_with_who_and_says_what_happens(standin: Standin, opened: Open, expect: Any) -> None:
    made.begin(standin.run)
    page = opened(standin.address)
    page.page.fill("#who", "Ann")
    assert "no emergency stop" in page.text("#stopsays")
    page.page.click("#stop")
    expect(page.page.locator("#stop")).to_have_text("STOPPING")
    expect(page.page.locator("#link")).to_contain_text("made safe")
    assert standin.run.stops == [{"by": "Ann"}]
    standin.run.tell("end", made.end("ABORTED", 4, "operator-stop: STOP by page: Ann"))
    expect(page.page.locator("#outcome")).to_have_text("ABORTED")
    expect(page.page.locator("#reason")).to_contain_text("exit status 4")
    expect(page.page.locator("#stopbar")).to_be_hidden()


def test_a_stop_that_does_not_get_through_says_so_and_can_be_pressed_again(
    standin: Standin, opened: Open, expect: Any
) -> None:
    made.begin(standin.run)
    page = opened(standin.address)
    expect(page.page.locator("#state")).to_have_text("LEVITATED")
    page.page.route("**/stop", lambda route: route.abort())
    page.page.click("#stop")
    expect(page.page.locator("#stopsays")).to_contain_text("did not get through")
    page.page.unroute("**/stop")
    page.page.click("#stop")
    expect(page.page.locator("#stop")).to_have_text("STOPPING")


def test_a_page_that_may_not_stop_has_no_button(standin: Standin, opened: Open, expect: Any) -> None:
    made.begin(standin.run, may_stop=False)
    page = opened(standin.address)
    expect(page.page.locator("#stopsays")).to_contain_text("only watches")
    expect(page.page.locator("#stop")).to_be_hidden()
