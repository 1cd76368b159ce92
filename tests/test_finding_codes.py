"""Codes of findings: each that is told is in a register, and each that is in one is told."""

from __future__ import annotations

import ast
import re
from collections import Counter
from pathlib import Path

import pytest

from bench.cli import findings_page
from bench.findings import Effect

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "reference" / "findings.md"
REGISTERED = {code: (room, meant) for room, codes in findings_page.registers() for code, meant in codes.items()}
KEBAB = re.compile(r"[a-z]+(-[a-z]+)*")
PARTS = {
    "{what}-exchanged": ("axes-exchanged", "planes-exchanged"),
    "{what}-saturated": ("current-saturated", "voltage-saturated"),
    "pulse-{kind}": ("pulse-missing", "pulse-doubled"),
}
MODULES = [p for room in ("bench", "procedures", "drivers") for p in sorted((ROOT / room).rglob("*.py"))]


def told(module: Path) -> set[str]:
    """The codes that a module gives a finding outright: texts, conditional texts, and those put together of parts."""
    found: set[str] = set()
    text = module.read_text(encoding="utf-8")
    if "Finding(" not in text:  # at every collection of the tests: most modules need no parsing
        return found
    for call in ast.walk(ast.parse(text)):
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "Finding" and call.args:
            for part in ast.walk(call.args[0]):
                if isinstance(part, ast.JoinedStr):
                    found |= set(PARTS.get(ast.unparse(part)[2:-1], ()))
                elif isinstance(part, ast.Constant) and KEBAB.fullmatch(str(part.value)):
                    found.add(str(part.value))
    return found


@pytest.mark.parametrize("module", [m for m in MODULES if told(m)], ids=lambda m: m.relative_to(ROOT).as_posix())
def test_every_code_that_is_told_is_registered(module: Path) -> None:
    left = told(module) - set(REGISTERED) - {"missing", "doubled", "axes", "planes", "code"}
    assert not left, f"register them in findings.toml of the room that tells them, or of one that it imports: {left}"


def test_every_registered_code_is_told_somewhere() -> None:
    whole = "\n".join(m.read_text(encoding="utf-8") for m in MODULES)
    made = {code for codes in PARTS.values() for code in codes}
    assert not [code for code in REGISTERED if f'"{code}"' not in whole and code not in made]


def test_a_code_has_one_meaning_in_one_line() -> None:
    count = Counter(code for _, codes in findings_page.registers() for code in codes)
    assert not [code for code, n in count.items() if n > 1]
    for code, (_, (effects, text)) in REGISTERED.items():
        assert KEBAB.fullmatch(code)
        assert {Effect(e) for e in effects.split(", ")}
        assert text
        assert len(text) < 110
        assert "\n" not in text


def test_the_page_is_made_from_the_registers() -> None:
    assert PAGE.read_text(encoding="utf-8") == findings_page.page(), (
        "run: python -m bench.cli.findings_page docs/reference/findings.md"
    )
