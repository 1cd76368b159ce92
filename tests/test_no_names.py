"""Procedures name no channel and no parameter of a rig: they ask by what it is, and the rig file has the names."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PROCEDURES = Path(__file__).resolve().parent.parent / "procedures"
FILES = sorted(PROCEDURES.rglob("*.py"))
ASKS = {"set", "get", "reading"}  # of a rig's levitation: the first argument is a name


def literals(node: ast.AST) -> Iterator[str]:
    """Texts that an expression is or is made of; those that choose something out of a table are its keys, no names."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    for part in () if isinstance(node, ast.Subscript | ast.Call) else ast.iter_child_nodes(node):
        yield from literals(part)


def named(tree: ast.AST) -> Iterator[str]:
    """Names of channels and parameters that a module has by itself."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.args:
            owner = node.func.value
            if node.func.attr in ASKS and isinstance(owner, ast.Attribute) and owner.attr == "levitation":
                yield from literals(node.args[0])
            if node.func.attr == "read":
                yield from (text for arg in node.args for text in literals(arg) if "." not in text)
        tabled = isinstance(node, ast.Subscript) and isinstance(node.value, ast.Attribute)
        if tabled and node.value.attr in ("parameters", "channels"):
            yield from literals(node.slice)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Requires":
            for word in node.keywords:
                if word.arg in ("channels", "parameters") and not isinstance(word.value, ast.Call):
                    yield from literals(word.value)
        if isinstance(node, ast.Compare) and 'e["name"]' in ast.unparse(node).replace("'", '"'):
            yield from (text for c in node.comparators for text in literals(c))


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PROCEDURES)))
def test_no_channel_and_no_parameter_is_named(path: Path) -> None:
    assert list(named(ast.parse(path.read_text(encoding="utf-8")))) == []


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ('rig.levitation.set("bias_i", 3.0)', ["bias_i"]),
        ('rig.parameters["gamma"].low', ["gamma"]),
        ('step.read(STATUS, "pos_yi")', ["pos_yi"]),
        ('Requires(channels=("angle", *channels))', ["angle"]),
        ('[e for e in events if e["name"] == "angle_ref"]', ["angle_ref"]),
        ("rig.levitation.set(parameter(rig, KEY), 3.0)", []),
        ('step.read("mark.angle")', []),
    ],
)
def test_what_would_be_found(code: str, found: list[str]) -> None:
    assert list(named(ast.parse(code))) == found
