"""A certificate that did not hold is told on page 1 and in the banner."""

from __future__ import annotations

import pytest
import report_samples as samples

from reports import compose


@pytest.mark.parametrize("code", ["certificate-overdue", "certificate-ahead"])
def test_it_stands_on_page_1_and_is_said_on_every_page(code: str) -> None:
    told = {"code": code, "text": "certificate span was due", "where": "certificates.span", "effect": "note"}
    view = compose.view_of(samples.record(findings=[told]), compose.Surroundings("A run", rig=samples.rig_content()))
    assert "Rests on a certificate that is out of date" in view.expired
    assert [f.code for f in view.warned] == [code]
    assert not view.notes
    assert not compose.view_of(samples.record(findings=[]), compose.Surroundings("A run")).warned
