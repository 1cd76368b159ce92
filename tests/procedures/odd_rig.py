"""The plain stand as yet another laboratory might have built it: axes that are not orthogonal and twisted from bearing to
bearing, probes that look along none of them, in three planes, one of them the other way round."""

from __future__ import annotations

from pathlib import Path

STAND = Path(__file__).resolve().parents[2] / "examples" / "plain-stand"
CHANGES = (
    ("axes.y_vorn = { direction = { value = 0,", "axes.y_vorn = { direction = { value = 25,"),
    ('{ of = "bearings/vorn/y_vorn", plus_deg = -90 }', '{ of = "bearings/vorn/y_vorn", plus_deg = -70 }'),
    ("axes.y_hinten = { direction = { value = 0,", "axes.y_hinten = { direction = { value = 10,"),
    ('{ of = "bearings/hinten/y_hinten", plus_deg = -90 }', '{ of = "bearings/hinten/y_hinten", plus_deg = -85 }'),
    ('direction = { of = "bearings/vorn/y_vorn", plus_deg = 0 } }',
     'direction = { of = "bearings/vorn/y_vorn", plus_deg = 15 } }'),
    ('direction = { of = "bearings/vorn/x_vorn", plus_deg = 0 } }',
     'direction = { of = "bearings/vorn/x_vorn", plus_deg = -10 }, sign = -1 }'),
    ('direction = { of = "bearings/hinten/y_hinten", plus_deg = 0 } }',
     'direction = { of = "bearings/hinten/y_hinten", plus_deg = -20 } }'),
    ('direction = { of = "bearings/hinten/x_hinten", plus_deg = 0 } }',
     'direction = { of = "bearings/hinten/x_hinten", plus_deg = 12 } }'),
    ('x_hinten = { channel = "LageXHinten", at = { value = -122,',
     'x_hinten = { channel = "LageXHinten", at = { value = -110,'),
)  # fmt: skip


def odd_rig(folder: Path) -> str:
    """The rig file in a folder, with its DBC."""
    text = (STAND / "stand.toml").read_text(encoding="utf-8")
    for old, new in CHANGES:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    (folder / "odd.toml").write_text(text, encoding="utf-8")
    (folder / "stand.dbc").write_bytes((STAND / "stand.dbc").read_bytes())
    return str(folder / "odd.toml")
