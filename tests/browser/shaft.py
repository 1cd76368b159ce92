"""What the made run of the stand-in server shows: 30 channels of a shaft in two bearings, as a rig file has them."""

from __future__ import annotations

import base64
import time
from typing import Any

import numpy as np

ZONES = (("A/B", 0.3), ("B/C", 0.4), ("C/D", 0.5))
MICRON, RPM = 1e-6, np.pi / 30
ENVELOPE_M, CLEARANCE_M, SPEED_RAD_S = 150e-6, 250e-6, 45.0


def channels() -> list[dict[str, Any]]:
    """30 channels to be drawn and two that are words, as a rig file has them."""
    found = []

    def add(name: str, unit: str, kind: str, group: str, upper: float | None = None, lower: float | None = None,
            **shown: Any) -> None:  # fmt: skip
        found.append(
            {"name": name, "unit": unit, "kind": kind, "group": group, "lower": lower, "upper": upper, **shown}
        )

    for place, letter in (("inboard", "i"), ("outboard", "o")):
        for axis in "yx":
            add(
                f"pos_{axis}{letter}", "m", "position", place, ENVELOPE_M, -ENVELOPE_M, display_unit="um", factor=MICRON
            )
        for coil in ("y{}_p", "y{}_n", "x{}_p", "x{}_n"):
            add(f"i_{coil.format(letter)}", "A", "current", place, 12.5)
    add("pos_z", "m", "position", "axial", display_unit="um", factor=MICRON)
    for coil in ("z_p", "z_n"):
        add(f"i_{coil}", "A", "current", "axial", 12.5)
    for k in range(1, 9):
        add(f"i_m{k}", "A", "current", "motor", 12.5)
    for name in ("temp_i", "temp_o", "temp_m"):
        add(name, "K", "temperature", "", 353.0, display_unit="degC", factor=1.0, offset=273.15)
    add("speed", "rad/s", "speed", "", 75.0, display_unit="r/min", factor=RPM)
    add("supply", "V", "supply", "", 160.0, 130.0)
    add("angle", "rad", "other", "", display_unit="deg", factor=np.pi / 180)
    add("host_age", "s", "other", "", display_unit="ms", factor=1e-3)
    add("state", "1", "state", "")
    add("fault", "1", "state", "")
    return found


def hello(**changed: Any) -> dict[str, Any]:
    orbits = [
        {"name": place, "x": f"pos_x{letter}", "y": f"pos_y{letter}", "clearance_m": CLEARANCE_M,
         "zones": [{"name": name, "radius_m": share * CLEARANCE_M} for name, share in ZONES]}
        for place, letter in (("inboard", "i"), ("outboard", "o"))
    ]  # fmt: skip
    return {
        "schema": 1, "run_id": "20261128T101500Z-amb-calibration-tsbs12", "procedure": "amb-calibration", "rig": "tsbs12",
        "title": "AMB force constants by hanging masses", "backend": "sim", "served": False, "seed": 1, "visit": 1,
        "started": "2026-11-28T10:15:00+00:00", "simulated": True, "may_stop": True, "channels": channels(), "orbits": orbits,
        "states": {"1": "READY", "2": "LEVITATED"}, "faults": {"0": "NONE"}, **changed,
    }  # fmt: skip


def packed(values: Any, kind: str) -> str:
    return base64.b64encode(np.asarray(values, kind).tobytes()).decode()


def samples(begin_s: float, end_s: float) -> dict[str, Any]:
    """What the channels do between two times, in buckets of 10 ms."""
    t = np.arange(round(begin_s * 100), round(end_s * 100)) / 100
    rng = np.random.default_rng(round(begin_s * 100))
    told = {}
    for k, channel in enumerate(channels()):
        low = _course(k, channel, t) + _spread(channel) * (rng.standard_normal(t.size) - 3)
        high = low + _spread(channel) * 6
        told[channel["name"]] = {"min": packed(low, "<f4"), "max": packed(high, "<f4"), "last": float(high[-1])}
    turn = np.linspace(0, 8 * np.pi, 400) + begin_s * SPEED_RAD_S
    orbits = {
        name: {
            "x": packed(size * np.cos(turn + lag) + 1e-6 * rng.standard_normal(400), "<f4"),
            "y": packed(0.8 * size * np.sin(turn) + 1e-6 * rng.standard_normal(400) - 2e-5, "<f4"),
        }
        for name, size, lag in (("inboard", 6e-5, 0.4), ("outboard", 3e-5, -0.2))
    }
    return {
        "t": packed(t, "<f8"), "lost": 0, "channels": told, "orbits": orbits, "state": "LEVITATED", "fault": "NONE",
        "speed_rpm": SPEED_RAD_S / RPM + 0.2 * float(rng.standard_normal()), "age_ms": 10.0, "sent_ms": 1e3 * time.time(),
    }  # fmt: skip


def _course(k: int, channel: dict[str, Any], t: np.ndarray) -> np.ndarray:
    slow = np.sin(2 * np.pi * t / (7 + k % 5) + k)
    match channel["kind"]:
        case "position":
            return 4e-5 * slow
        case "current":
            return 3.0 + 0.3 * (k % 4) + 0.8 * slow
        case "temperature":
            return 300.0 + 0.1 * slow
        case "speed":
            return SPEED_RAD_S + 0.05 * slow
        case "supply":
            return 148.0 + 0.4 * slow
        case _:
            return 0.01 + 0.005 * slow


def _spread(channel: dict[str, Any]) -> float:
    return {"position": 2e-6, "current": 0.02, "temperature": 0.02, "speed": 0.01, "supply": 0.05}.get(
        channel["kind"], 1e-4
    )
