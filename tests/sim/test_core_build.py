"""Building the core: when it is rebuilt, and what is said when it cannot be."""

from __future__ import annotations

import ctypes
import dataclasses
from pathlib import Path

import pytest

from bench.errors import ConfigError
from sim_backend.core import build
from sim_backend.machines.tsbs import plant
from sim_backend.machines.tsbs.params import ControlParams, PlantParams


@pytest.fixture
def sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small core of its own; the real one is built by whoever runs these tests."""
    (tmp_path / "tsbs.h").write_text("int one(void);\n")
    (tmp_path / "tsbs.c").write_text('#include "tsbs.h"\nint one(void) { return 1; }\n')
    monkeypatch.setattr(build, "HERE", tmp_path)
    monkeypatch.setattr(build, "MACHINES", tmp_path / "machines")
    return tmp_path


def test_built_once_and_again_when_a_header_changes(sources: Path) -> None:
    first = build.library()
    assert first.parent == sources
    stamp = first.stat().st_mtime_ns
    assert build.library() == first
    assert first.stat().st_mtime_ns == stamp
    with (sources / "tsbs.h").open("a") as header:
        header.write("/* changed */\n")
    second = build.library()
    assert second != first
    assert not first.exists()


def test_a_machine_s_folder_belongs_to_it(sources: Path) -> None:
    without = build.library()
    folder = sources / "machines" / "pendulum"
    folder.mkdir(parents=True)
    (folder / "law.c").write_text('#include "tsbs.h"\nint two(void) { return 2 * one(); }\n')
    with_it = build.library()
    assert with_it != without
    assert ctypes.CDLL(str(with_it)).two() == 2


def test_no_compiler(sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(sources / "nothing"))
    with pytest.raises(ConfigError, match="no C compiler"):
        build.library()


def test_compiler_output_is_in_the_error(sources: Path) -> None:
    (sources / "tsbs.c").write_text("this is not C")
    with pytest.raises(ConfigError, match=r"tsbs\.c"):
        build.library()
    assert not list(sources.glob("*.so"))


@pytest.mark.parametrize(("kind", "struct"), [(PlantParams, "tsbs_params"), (ControlParams, "tsbs_control")])
def test_every_field_of_the_header_has_a_default(kind: type, struct: str) -> None:
    declared = {name: field.type for name, field in plant._ffi.typeof(struct).fields}
    defaults = kind()
    assert set(declared) == {f.name for f in dataclasses.fields(kind)}
    for name, ctype in declared.items():
        value = getattr(defaults, name)
        assert (len(value) if isinstance(value, tuple) else None) == (ctype.length if ctype.kind == "array" else None)
