"""What a report says of its outcome: what was judged, which findings decide, and what it does not claim."""

from __future__ import annotations

from report_samples import Page, around, measurement, view

from reports import html, pdf


def test_page_one_has_what_was_judged_the_worst_first_and_what_decided() -> None:
    made = view(
        outcome="FAIL",
        findings=[{"code": "clipped", "text": "A probe clips.", "where": "yi", "effect": "indeterminate"},
                  {"code": "slow", "text": "It was slow.", "where": "", "effect": "note"}],
        measurements=[measurement("a"), measurement("b", verdict="none", limit=None), measurement("c", verdict="fail")],
        correlations=None,
    )  # fmt: skip
    assert (made.judged_title, [r.symbol.plain for r in made.judged]) == ("What was judged", ["c", "a"])
    assert made.judged_note == "1 more result in the sections below."
    assert [f.code for f in made.decided] == ["clipped"]
    assert [f.code for f in made.notes] == ["slow"]
    assert [b.symbol.plain for b in made.budgets] == ["a", "c"]
    assert [b.symbol.plain for b in made.more_budgets] == ["b"]


def test_findings_that_affect_the_outcome_are_loud() -> None:
    loud = {"code": "mass-suspect", "text": "M3 is off the line.", "where": "M3", "effect": "indeterminate"}
    made = view(findings=[loud], outcome="INDETERMINATE")
    assert made.decided[0].loud
    assert "mass-suspect" in made.outcome_text
    assert 'class="finding loud"' in html.render(made)


def test_a_fail_stands_first_and_says_where_a_finding_outranks_it() -> None:
    doubt = {"code": "load-inconsistent", "text": "The loads contradict each other.", "where": "M2",
             "effect": "indeterminate", "concerns": []}  # fmt: skip
    failed = [measurement("K_o", verdict="fail"), measurement("K_i")]
    made = view(outcome="INDETERMINATE", findings=[doubt], measurements=failed, correlations=None)
    assert made.outcome_text.startswith("Outside the limits with the whole 95 % interval: K_o.")
    assert "no statement of non-conformity: the data are contradicted (load-inconsistent)" in made.outcome_text
    assert made.judged[0].verdict == "fail"
    touched = view(outcome="FAIL", findings=[doubt | {"concerns": ["K_i"]}], measurements=failed, correlations=None)
    assert touched.outcome_text == (
        "Outside the limits with the whole 95 % interval: K_o. Findings that prevent other decisions: load-inconsistent."
    )


def test_a_run_that_nothing_judged_has_a_neutral_box() -> None:
    made = view(outcome="DONE", measurements=[measurement(verdict="none", limit=None)], correlations=None)
    assert (made.tone, made.outcome) == ("none", "DONE")
    assert made.outcome_text == "Every declared quantity was measured. No acceptance limit was applied."
    assert 'class="outcome none"' in html.render(made)
    assert pdf.render(made, None).startswith(b"%PDF")


def test_what_a_note_leaves_untold_was_not_measured() -> None:
    """Page 1 said of a run that tells no damping that every declared quantity was measured."""
    note = {"code": "no-oscillation", "text": "None fits.", "where": "A, y", "effect": "note",
            "concerns": ["damping@A, y", "natural_frequency@A, y"]}  # fmt: skip
    made = view(
        outcome="DONE", measurements=[measurement(verdict="none", limit=None)], findings=[note], correlations=None
    )
    assert made.outcome_text == (
        "Every declared quantity was measured, but not damping, natural frequency everywhere (no-oscillation). "
        "No acceptance limit was applied."
    )


def test_pass_without_limits_claims_no_conformity() -> None:
    made = view(measurements=[measurement(verdict="none", limit=None)])
    assert made.outcome_text.endswith("No acceptance limit was applied.")


def test_an_error_without_measurements_says_that_it_says_nothing() -> None:
    lost = {"code": "link-lost", "text": "No frame for 0.5 s.", "where": "can0", "effect": "error"}
    made = view(
        around(rig={}, integrity=None, readable=False),
        outcome="ERROR", measurements=[], correlations=[], ended=None, recording=None, findings=[lost],
    )  # fmt: skip
    page = Page(html.render(made)).text
    assert "makes no statement about the item tested" in page
    assert "end not recorded" in page
    assert "link-lost" in made.outcome_text
    assert pdf.render(made).startswith(b"%PDF")


def test_a_truncated_recording_is_said_aloud() -> None:
    stopped = {"code": "operator-abort", "text": "Stopped.", "where": ""}
    made = view(around(truncated=True), outcome="ABORTED", findings=[stopped])
    assert made.decided[0].loud
    assert "truncated" in made.link_note
    assert made.outcome_text == "The run was stopped before its end. See the finding operator-abort."
