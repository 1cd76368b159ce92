"""Rig files of foreign controllers around the simulated servomotor."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OWN = ROOT / "examples" / "own-controller"
OPERATOR = '[links.operator]\nurl = "line:127.0.0.1:0"\n\n[devices.operator]\nlink = "operator"\nroles = ["operator"]\n'


def plain_text() -> str:
    """examples/own-controller/plainamb.toml with what rigs/tsbs12.toml says of the machine that is simulated."""
    native = (ROOT / "rigs" / "tsbs12.toml").read_text(encoding="utf-8")
    plain = (OWN / "plainamb.toml").read_text(encoding="utf-8")
    motor = next(line for line in native.splitlines() if line.startswith("motor_to_outboard_amb = "))
    plain = plain.replace("[geometry]\n", f"[geometry]\n{motor}\n", 1)
    machine = native[native.index("[machine]\n") : native.index("# The machine (docs")]
    drawn = native[native.index("[simulation]\n") :]
    plain = plain.replace("[masses]\n", f"{machine}\n[masses]\n", 1)
    plain = plain.replace("[devices.controller]\n", f"{OPERATOR}\n[devices.controller]\n", 1)
    return f"{plain}\n{drawn}"


def written(folder: Path, toml: str = "", dbc: str = "") -> str:
    """The rig file's path in a folder, with its DBC beside it."""
    (folder / "plainamb.toml").write_text(toml or plain_text(), encoding="utf-8")
    (folder / "plainamb.dbc").write_text(dbc or (OWN / "plainamb.dbc").read_text(encoding="utf-8"), encoding="utf-8")
    return str(folder / "plainamb.toml")
