"""Numbers of the rig file keep their identity through an adoption, in one form; what a run makes of them is its own."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest

from bench.calibration import adopted, certificates_of
from bench.calibration.file import from_json, read, to_json
from bench.rigfile import load_rig
from bench.rigfile.certificates import certified_numbers
from bench.rigfile.toleranced import Toleranced
from bench.uncertainty import Estimate, Influence, correlation

GOLDEN = Path(__file__).parent / "calibrations" / "golden.json"
PITCH, ERROR = (Toleranced(value=v, unit="m", half_width=h, distribution="rectangular", source="C")
                for v, h in ((2e-6, 6e-11), (0.0, 1e-6)))  # fmt: skip
COUNT = PITCH.standard_uncertainty
SCALE = Influence("encoders/x/pitch", "scale", COUNT / 2e-6, "1", "B", "rectangular")
STATED = {
    "encoders/x/pitch": PITCH,
    "encoders/x/error": ERROR,
    "hooks/near/at": PITCH,
    "capabilities/cell/gain": PITCH,
    "capabilities/cell/drift": PITCH,
}


def test_numbers_of_any_table_of_the_rig_file_keep_their_identity_each_in_its_own_unit() -> None:
    """An encoder's pitch as a share, a hook's place and a load cell's gain; what each contributes stays."""
    ours = [Influence(i, "", COUNT, "m", "B", "rectangular") for i in ("hooks/near/at", "capabilities/cell/gain")]
    before = Estimate(1.0, "m", {SCALE: -3.0, ours[0]: 2.0, ours[1]: 1.0})
    after = adopted({"a": before}, "run-a", (), STATED)["a"]
    assert {i.id: (i.u, i.unit) for i in after.sensitivities} == dict.fromkeys(
        ("encoders/x/pitch", "hooks/near/at", "capabilities/cell/gain"), (COUNT, "m")
    )
    assert after.contributions == pytest.approx(before.contributions, rel=1e-12)


@pytest.mark.parametrize("of", [
    Influence("encoders/x/error/sine", "", ERROR.standard_uncertainty / math.sqrt(2), "m", "B", "rectangular"),  # a part
    Influence("hooks/far/at", "", COUNT, "m", "B", "rectangular"),  # no number
    Influence("hooks/near/at", "", 1e-9, "m", "B", "rectangular"),  # a bound of the run's own
    Influence("hooks/near/at", "", COUNT, "m", "B", "normal"),
    Influence("hooks/near/at", "", COUNT, "m", "A", "rectangular"),
    Influence("hooks/near/at", "", COUNT, "m", "B", "rectangular", 8.0),
    Influence("capabilities/cell/drift", "", COUNT, "m", "B", "rectangular"),  # another way in each run
])  # fmt: skip
def test_what_a_run_makes_of_a_number_is_its_own(of: Influence) -> None:
    (facts,) = adopted({"a": Estimate(1.0, "m", {of: 1.0})}, "run-a", (), STATED).values()
    assert [(i.id, i.u, i.unit) for i in facts.sensitivities] == [(f"run-a/{of.id}", of.u, of.unit)]


def test_a_result_has_a_scale_directly_and_by_a_calibration() -> None:
    """By hand: F/x = 74 N/m over a length that an encoder reads is adopted, with the encoder's scale as a share; a later run
    reads 5 mm by the same encoder, and has its force of 0.37 N without the scale; x/k has it twice."""
    stiffness = adopted({"k": Estimate(74.0, "N/m", {SCALE: -74.0})}, "run-a", (), STATED)["k"]
    kept = from_json(to_json(dataclasses.replace(read(GOLDEN), values={"k": stiffness}))).values["k"]
    travel = Estimate(5e-3, "m", dict.fromkeys(kept.sensitivities, 0.005 / PITCH.value))
    assert (kept * travel).value == pytest.approx(0.37)
    assert (kept * travel).u == pytest.approx(0.0, abs=1e-15)
    assert (travel / kept).u == pytest.approx(2 * 5e-3 / 74.0 * SCALE.u)
    assert correlation(kept, travel) == pytest.approx(-1.0)


def test_a_run_is_adopted_with_the_identities_of_its_own_rig_file() -> None:
    """The scale of a stage's encoder, as its rig file has it: its certificate is kept with the calibration too."""
    rig, identity = load_rig("rlsrm"), "encoders/x/pitch"
    number = certified_numbers(rig)[identity]
    kept = certificates_of(rig, [identity, "encoders/x/pitch/2", "encoders/none/pitch"])
    assert [(i, c.value, c.u) for i, c in kept.items()] == [(identity, number.value, number.standard_uncertainty)]
