"""The script that compares two commits: what it says of a difference of one bit, and that a run repeats itself."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks import golden

ROOT = Path(__file__).resolve().parents[1]
RECORD = {
    "outcome": "PASS",
    "measurements": [{"name": "K_i", "value": 75.3, "budget": []}, {"name": "K_o", "value": 76.0}],
}


def test_one_bit_is_a_difference_and_its_place_is_told() -> None:
    moved = {
        **RECORD,
        "measurements": [{"name": "K_i", "value": math.nextafter(75.3, 80), "budget": []}, {"name": "K_o"}],
    }
    assert list(golden.differences(RECORD, RECORD)) == []
    assert list(golden.differences(RECORD, moved)) == [
        "/measurements/K_i/value: 75.3 -> 75.30000000000001",
        "/measurements/K_o/value: 76.0 -> None",
    ]


def test_what_is_missing_is_a_difference() -> None:
    assert list(golden.differences(RECORD, {"outcome": "PASS", "measurements": []}))
    assert list(golden.differences({}, {"/telemetry": [3, "ab"]})) == ["//telemetry: None -> [3, 'ab']"]


@pytest.mark.long
@pytest.mark.timeout(300)
def test_a_commit_equals_itself() -> None:
    done = subprocess.run(
        [sys.executable, "benchmarks/golden.py", "HEAD", "HEAD", "--only", "step"],
        cwd=ROOT,
        text=True,
        capture_output=True,
    )
    assert done.stdout == "step: equal\n1 of 1 procedures equal\n", done.stderr
