"""Facts of a bearing model by axis, whatever the rig calls them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bench.calibration import Calibration
from bench.errors import AnalysisError
from bench.uncertainty import Estimate
from procedures.synchronous.bearings import _fact


def test_a_fact_is_found_by_either_name_and_missed_by_its_place() -> None:
    old = Estimate.exact(7e-7, "N m^2/A^2")
    stated = Calibration("bearing-model", {"beta_yi": old}, {})
    assert _fact(stated, "beta", "yi") is old
    assert _fact(replace(stated, values={"beta@u1": old}), "beta", "u1") is old
    with pytest.raises(AnalysisError, match="has no beta@yo"):
        _fact(stated, "beta", "yo")
