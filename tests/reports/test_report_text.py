"""Rounding and notation, against values worked out by hand."""

from __future__ import annotations

import pytest

from reports import text
from reports.linktable import clean, link_table

N = text.NARROW


@pytest.mark.parametrize(
    ("value", "expanded", "unit", "expected"),
    [
        (23.41234, 0.0824, "N/A", f"(23.412 ± 0.082){N}N/A"),
        (23.41234, 0.0996, "N/A", f"(23.41 ± 0.10){N}N/A"),  # the carry moves the last digit
        (-0.0004, 0.021, "A", f"(0.000 ± 0.021){N}A"),  # no negative zero
        (-1.2345, 0.021, "A", f"({text.MINUS}1.234 ± 0.021){N}A"),
        (242600.0, 2422.4, "N/m", f"(242.6 ± 2.4){N}×{N}10³{N}N/m"),
        (242600.0, 122000.0, "N/m", f"(2.4 ± 1.2){N}×{N}10⁵{N}N/m"),  # no zeros that say nothing
        (1.23456e-6, 6.7e-8, "m", f"(1.235 ± 0.067){N}×{N}10⁻⁶{N}m"),
        (12345.678, 0.5, "", f"12{N}345.68 ± 0.50"),
        (0.01230, 0.0002, "rad", f"(0.012{N}30 ± 0.000{N}20){N}rad"),
        (45.2, 1.6, "deg", "(45.2 ± 1.6)°"),
    ],
)
def test_result_has_two_digits_of_the_uncertainty(value: float, expanded: float, unit: str, expected: str) -> None:
    assert text.result(value, expanded, unit) == expected


@pytest.mark.parametrize(
    ("unit", "expected"),
    [
        ("A s/m", "A·s/m"),
        ("N/A^2", "N/A²"),
        ("kg/m3", "kg/m³"),
        ("um", "µm"),
        ("s^-1", "s⁻¹"),
        ("m^(-2)", "m⁻²"),
        ("r/min/(kg m^2)", "r/min/(kg·m²)"),
        ("1", ""),
        ("N*m", "N·m"),
    ],
)
def test_units_are_typeset(unit: str, expected: str) -> None:
    assert text.unit_text(unit) == expected


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("K_i", ("K", "i")),
        ("K2_o", ("K", "2,o")),
        ("alpha_x", ("α", "x")),
        ("gamma_0t", ("γ", "0t")),
        ("alpha_tau", ("α", "τ")),
        ("alpha_x_prime", ("alpha_x_prime", "")),
        ("x", ("x", "")),
        ("", ("", "")),
    ],
)
def test_symbols(name: str, expected: tuple[str, str]) -> None:
    assert text.symbol(name) == expected


@pytest.mark.parametrize(("dof", "expected"), [(None, "∞"), (9.99, "9"), (10.0, "10"), (999.5, "999"), (1e9, "> 999")])
def test_degrees_of_freedom_are_truncated(dof: float | None, expected: str) -> None:
    assert text.degrees_of_freedom(dof) == expected


def test_interval_is_rounded_like_its_result() -> None:
    assert text.interval(1.1e-6, 1.35e-6, 6.7e-8, "m") == f"[1.100,\u00a01.350]{N}×{N}10⁻⁶{N}m"


def test_plain_keeps_what_was_written() -> None:
    assert [text.plain(v) for v in (2.0, 0.15, 5e-5, True, 872341)] == [
        "2",
        "0.15",
        f"5{N}×{N}10⁻⁵",
        "yes",
        f"872{N}341",
    ]


def test_the_links_table_says_what_happened_and_the_note_what_did_not() -> None:
    link = {"frames": 1234, "gaps": 2, "errors": 0, "counts": {"gaps": 2, "lost": 7, "crc_errors": 0, "sent": 50,
            "longest_heartbeat_gap_ns": 21_340_000}, "drift_ppm": 12.34, "drift_expanded_ppm": 0.56,
            "latest_ms": 3.21, "round_trip_ms": None}  # fmt: skip
    rows = dict(link_table(link).rows)
    assert rows["Frames recorded"] == "1234"
    assert rows["Samples lost"] == "7"
    assert rows["Longest time between heartbeats"] == f"21.3{N}ms"
    assert rows["Host clock against the controller's, parts per million"] == "12.34 ± 0.56"
    assert rows["Greatest lateness of a sample"] == f"3.21{N}ms"
    assert clean(link) == "Watched for and not seen: packets with a wrong CRC."
