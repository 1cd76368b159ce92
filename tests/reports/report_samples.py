"""Hand-written records and rigs, with the fields that record.json and a rig file have, and pages read by their words."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from html.parser import HTMLParser
from typing import Any

import numpy as np

from bench.figures import Figure, Series
from bench.procedure import Quantity
from reports import compose
from reports.view import ReportView

HOSTILE = '<script>alert("x")</script> #include "a.typ" [b] $x^2$ \\n *c* _d_ `e` @f // g {{ 7*7 }} &amp; ~'
RUN_ID = "amb-calibration-20260101T000000Z-3f2a"
K_I = Quantity("K_i", "N/A", "inboard AMB: dF/di at zero control current")
TITLE = "AMB force-current constants"


def budget() -> list[dict[str, Any]]:
    """Nine influences; the last two are negligible."""
    rows = (
        ("current sensor gain, inboard", "sensors/i_yi_p/gain", 0.0392, 23.4, "B", "rectangular", None, "1"),
        ("AMB span", "geometry/amb_span", 0.0094, 187.2, "B", "normal", None, "m"),
        ("hook to outboard AMB", "geometry/hook_to_outboard", 0.0078, 156.0, "B", "normal", None, "m"),
        ("angle dependence, mean over a turn", "run/angle", 0.0061, 1.0, "A", "t", 7, "N/A"),
        ("residuals of the fit", "run/fit", 0.0041, 1.0, "A", "t", 69, "N/A"),
        ("local gravity", "site/gravity", 0.0012, 2.385, "B", "normal", None, "m/s^2"),
        ("mass M4", "masses/M4", 0.0009, 7.8, "B", "normal", None, "kg"),
        ("air density", "site/air_density", 0.00017, -0.0029, "B", "rectangular", None, "kg/m3"),
        ("mass M1", "masses/M1", 0.00011, 7.8, "B", "normal", None, "kg"),
    )
    names = ("name", "influence", "contribution", "sensitivity", "type", "distribution", "dof", "unit")
    return [dict(zip(names, row, strict=True)) for row in rows]


def measurement(name: str = "K_i", value: float = 23.41234, u: float = 0.0420, **changes: Any) -> dict[str, Any]:
    """One measurement of record.json."""
    made: dict[str, Any] = {
        "name": name,
        "unit": "N/A",
        "value": value,
        "standard_uncertainty": u,
        "dof": 812.7,
        "coverage_factor": 1.963,
        "expanded_uncertainty": 1.963 * u,
        "method": "gum",
        "verdict": "pass",
        "limit": {"low": 22.0, "high": 25.0, "source": "drawing 12-004, table 2", "verified": True},
        "where": "",
        "interval": [value - 1.963 * u, value + 1.963 * u],
        "coverage_probability": 0.95,
        "budget": budget(),
    }
    return made | changes


def record(**changes: Any) -> dict[str, Any]:
    """A passed, simulated run with two results."""
    made: dict[str, Any] = {
        "schema": 1,
        "run_id": RUN_ID,
        "procedure": "amb-calibration",
        "rig": "tsbs12",
        "uut": {"name": "TSBS motor", "serial": "TSBS-12-001"},
        "outcome": "PASS",
        "started": "2026-01-01T00:00:00Z",
        "ended": "2026-01-01T00:14:32Z",
        "seed": 1,
        "plan": {"angles": 8, "settle_s": 2.0, "average_s": 1.0, "masses": ["M1", "M2", "M3", "M4"], "order": "up"},
        "calibrations": [],
        "versions": {"levbench": "0.1.0", "python": "3.11.7", "numpy": "2.4.6", "core": "sha256:9f2c"},
        "recording": {"file": "recording.mcap", "sha256": "a3f1" * 16},
        "link": {"frames": 872341, "gaps": 0, "errors": 0},
        "findings": [
            {"code": "return-to-zero", "text": "Return to zero within 0.4 mN.", "where": "all angles", "effect": "note"}
        ],
        "measurements": [measurement(), measurement("K_o", 31.2049, 0.061, verdict="none", limit=None)],
        "correlations": [[1.0, -0.4312], [-0.4312, 1.0]],
    }
    return made | changes


def toleranced(value: float, unit: str, **more: Any) -> dict[str, Any]:
    return {"value": value, "unit": unit, **more}


def rig_content() -> dict[str, Any]:
    """The content of a rig file, as far as a report reads it."""
    cal = {"distribution": "normal", "source": "certificate SIM-M-001 (simulated)"}
    gain = {"half_width": 0.003, "distribution": "rectangular", "source": "data sheet of the current sensor"}
    return {
        "name": "tsbs12",
        "title": "Toothless self-bearing servomotor on three AMBs",
        "site": {
            "place": "Edmonton",
            "latitude_deg": 53.527,
            "elevation_m": 668,
            "gravity": toleranced(9.81123, "m/s^2", u=4.9e-4, k=1, distribution="normal", source="latitude formula"),
            "air_density": toleranced(1.11, "kg/m3", half_width=0.05, distribution="rectangular", source="site"),
        },
        "geometry": {
            "hook_to_outboard": toleranced(0.150, "m", u=5e-5, k=1, distribution="normal", source="CMM report"),
            "amb_span": toleranced(0.125, "m", u=5e-5, k=1, distribution="normal", source="CMM report"),
        },
        "masses": {
            name: toleranced(kg, "kg", u=mg * 1e-6, k=2, **cal)
            for name, kg, mg in (("M1", 0.5, 50), ("M2", 1.0, 100), ("M3", 2.0, 200), ("M4", 3.0, 300))
        },
        "sensors": {f"i_{c}": {"gain": toleranced(1.0, "", **gain)} for c in ("xi_p", "xi_n", "yi_p", "yi_n")},
        "simulation": {"secret": toleranced(42.4242, "N/A", half_width=1.0)},
    }


@dataclass(frozen=True)
class SampleRig:
    """Stands for a RigFile: only its content is asked for."""

    content: dict[str, Any] = field(default_factory=rig_content)

    def model_dump(self, **_: Any) -> dict[str, Any]:
        return self.content


@dataclass(frozen=True)
class SampleRecording:
    """What `build` reads of a Recording."""

    rig: SampleRig = field(default_factory=SampleRig)
    truncated: bool = False
    integrity: dict[str, Any] = field(
        default_factory=lambda: {"telemetry": {"samples": 872000, "lost": 0, "duplicates": 0, "reordered": 0}}
    )


def figures() -> list[Figure]:
    """Fit, residuals, one step and a turn, twice."""
    rng = np.random.default_rng(1)
    amps = np.array([0.0, 0.21, 0.42, 0.84, 1.26, 1.26, 0.84, 0.42, 0.21, 0.0])
    angles = np.arange(8) * np.pi / 4
    t = np.arange(3000) / 1000
    ring = np.exp(-3 * t) * np.cos(40 * t)
    made = []
    for place, key in (("inboard", "i"), ("outboard", "o")):
        line = np.linspace(0, 1.3, 50)
        points = Series("measured", amps, 23.4 * amps, "points", np.full(10, 0.4))
        fit = (points, Series("quadratic fit", line, 23.4 * line))
        about = "Force at the bearing against its control current, up and down at 0°."
        made.append(
            Figure(f"fit-{key}", f"Force and current, {place} AMB", about, "control current / A", "force / N", fit)
        )
        cloud = tuple(Series(f"{d}°", amps, rng.normal(0, 5, 10), "points") for d in range(0, 360, 45))
        zero = (("zero", 0.0),)
        about = "Residuals of the quadratic fit at every angle."
        made.append(
            Figure(
                f"res-{key}", f"Residuals, {place}", about, "control current / A", "residual / mN", cloud, lines=zero
            )
        )
        turn = (Series("tangent at zero current", angles, 23.4 + 0.1 * np.cos(angles), "both", np.full(8, 0.05)),)
        about = "The radial axis does not begin at zero."
        made.append(
            Figure(
                f"turn-{key}",
                f"Around a turn, {place}",
                about,
                "rotor / °",
                "K / (N/A)",
                turn,
                "polar",
                (("mean", 23.4),),
            )
        )
        curves = (Series("inboard", t, 10 * ring + rng.normal(0, 0.1, t.size)), Series("outboard", t, 6 * ring))
        made.append(
            Figure(f"step-{key}", f"One step, {place}", "2 kg hung at t = 0.", "time / s", "position / µm", curves)
        )
    return made


def around(**changes: Any) -> compose.Surroundings:
    sample = SampleRecording()
    made = compose.Surroundings(
        title=TITLE,
        method="Masses are hung.\n\nA fit is made.",
        definitions={"K_i": K_I.about},
        rig=rig_content(),
        integrity=sample.integrity,
    )
    return replace(made, **changes)


def view(surroundings: compose.Surroundings | None = None, **changes: Any) -> ReportView:
    return compose.view_of(record(**changes), surroundings or around())


class Page(HTMLParser):
    """The words of a page, and its tags."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.words: list[str] = []
        self.tags: list[str] = []
        self.feed(source)
        self.text = " ".join(" ".join(self.words).split())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)

    def handle_data(self, data: str) -> None:
        self.words.append(data)
