"""Reference instruments: read by the operator on both sides of a line, with errors of their own within what is stated."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bench.errors import OperatorAbort, OperatorRefused
from bench.rigfile.capabilities_of_reference import ReferenceInstrument
from drivers.answers import reading_of
from drivers.operator import LineOperator
from drivers.person import ConsoleOperator
from sim_backend.instrument import DEFECTS, Instruments, scale_error, stated

UM = 1e-6


def number(value: float, half: float, unit: str) -> dict[str, Any]:
    return {"value": value, "unit": unit, "half_width": half, "distribution": "rectangular", "source": "a test"}


LASER = {
    "instrument": "laser", "unit": "um", "gain": number(1, 1e-5, "1"), "resolution": 1e-8, "drift": number(0, 1e-3, "um/s"),
    "error": {"value": 0, "unit": "um", "u": 0.1, "distribution": "normal", "source": "a test"},
    "noise": {"value": 0, "unit": "um", "u": 0.05, "distribution": "normal", "source": "a test"},
}  # fmt: skip
RIG: Any = SimpleNamespace(
    capabilities=SimpleNamespace(reference={"x": ReferenceInstrument.model_validate(LASER)}),
    encoders={"x": SimpleNamespace(measures="stroke")},
)


class Clock:
    def __init__(self) -> None:
        self.slept = 0.0

    def now_ns(self) -> int:
        return round(self.slept * 1e9)

    def sleep(self, seconds: float) -> None:
        self.slept += seconds


def truth(seed: int = 1, **planted: float) -> Any:
    values = {"reference.x.gain": 1 + 1e-5, "reference.x.drift": 0.0}
    return SimpleNamespace(seed=seed, visit=0, values=values, defects={**DEFECTS, **planted}, seen=[])


def instruments(of: Any, place: float = 0.01, now: float = 0.0) -> Instruments:
    return Instruments(RIG, of, {"x": lambda: place}, lambda: now)


def asked(answer: str) -> tuple[LineOperator, Clock]:
    clock = Clock()
    return LineOperator(lambda line: answer, clock, None), clock  # type: ignore[arg-type]


def test_it_reads_the_true_place_with_its_own_error() -> None:
    of = truth()
    words = instruments(of).request("x").split()
    assert words[0] == "ok"
    assert words[3] == "um"
    assert float(words[2]) == pytest.approx(10_000 + 0.1, abs=1.0)
    assert float(words[2]) * 100 == pytest.approx(round(float(words[2]) * 100), abs=1e-6)  # whole steps of 0.01 um
    assert of.seen == [("x", 0.01)]


def test_scale_and_noise_are_as_large_as_stated() -> None:
    one = RIG.capabilities.reference["x"]
    off = [scale_error("x", one, place, seed, RIG) for seed in range(60) for place in np.linspace(-0.01, 0.01, 20)]
    assert np.std(off) == pytest.approx(0.1 * UM, rel=0.1)
    here = instruments(truth())
    shown = [float(here.request("x").split()[2]) for _ in range(400)]
    assert np.std(shown) == pytest.approx(0.05, rel=0.15)


@pytest.mark.parametrize(
    ("planted", "factor"), [("reference_sign", -1.0), ("reference_unit", 1000.0), ("reference_mistyped", 1.0)]
)
def test_what_is_planted(planted: str, factor: float) -> None:
    value = float(instruments(truth(**{planted: factor})).request("x").split()[2])
    assert value / 10_000.1 == pytest.approx(10.0 if planted == "reference_mistyped" else factor, rel=1e-3)


def test_what_no_instrument_reads_is_said() -> None:
    assert instruments(truth()).request("y") == "error no instrument reads y"


def test_what_is_drawn() -> None:
    assert set(stated(RIG)) == {"reference.x.gain", "reference.x.drift"}


def test_the_line_has_seconds_number_and_unit() -> None:
    hands, clock = asked("ok 2.5 1.25 mm")
    assert hands.read("x", "laser", "m") == pytest.approx(1.25e-3)
    assert clock.slept == 2.5
    hands, _ = asked("ok 1 90 deg")
    assert hands.read("angle", "polygon", "rad") == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    "answer", ["", "ok", "ok 1", "ok 1 much", "ok 1 nan um", "ok 1 2 K", "error no instrument reads x"]
)
def test_another_answer_is_refused(answer: str) -> None:
    with pytest.raises(OperatorRefused, match="read laser of axis x"):
        asked(answer)[0].read("x", "laser", "m")


def test_a_person_types_a_number_with_or_without_its_unit() -> None:
    questions: list[str] = []

    def person(*answers: str) -> ConsoleOperator:
        left = list(answers)
        return ConsoleOperator(lambda q: questions.append(q) or left.pop(0), Clock(), None, None)  # type: ignore[arg-type,func-returns-value]

    assert person("12.5").read("x", "laser", "mm") == pytest.approx(12.5e-3)
    assert person("a lot", "12,5", "12.5 um").read("x", "laser", "mm") == pytest.approx(12.5e-6)
    assert "do not touch the machine" in questions[0]
    assert "'a lot' is no answer here" in questions[2]
    with pytest.raises(OperatorAbort):
        person("stop").read("x", "laser", "mm")


def test_numbers_with_units() -> None:
    assert reading_of("1e-3", "m") == 1e-3
    assert reading_of("1 rad", "m") is None
    assert reading_of("inf", "m") is None
