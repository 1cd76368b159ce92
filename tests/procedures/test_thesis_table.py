"""The nominal rig through the whole chain: what the thesis prints lies inside the stated intervals."""

import pytest

from benchmarks import thesis_table


@pytest.mark.long
@pytest.mark.timeout(300)
def test_printed_values_lie_inside(capsys: pytest.CaptureFixture[str]) -> None:
    assert thesis_table.main() == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2 + len(thesis_table.PRINTED)


def test_a_value_elsewhere_is_outside(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """The finite-element constants (T Table 5.3) are of another machine."""
    from bench.procedure import Quantity
    from bench.uncertainty import Estimate, Influence

    quantity = Quantity("alpha_d", "N/A", "direct force constant")
    one = Influence("x", "x", 0.01, "N/A", "B", "normal")
    monkeypatch.setattr(thesis_table, "chain", lambda: {"alpha_d": quantity.measured(Estimate.of(12.1, one))})
    monkeypatch.setattr(thesis_table, "PRINTED", (thesis_table.Printed("alpha_d", 19.36, 1.0, "N/A", "Table 5.3"),))
    assert thesis_table.main() == 1
    assert "NO" in capsys.readouterr().out
