"""Building the core: when it is rebuilt, and what is said when it cannot be."""

from __future__ import annotations

import ctypes
import dataclasses
import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest

from bench.errors import ConfigError
from sim_backend.core import build
from sim_backend.core import plant as core
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


@pytest.fixture
def cache(sources: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The sources are an installed package's; what is built for the user goes here."""
    folder = tmp_path_factory.mktemp("cache")
    monkeypatch.setattr(build, "CLONE", sources / "pyproject.toml")
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    return folder / "levbench"


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


def test_an_installed_package_is_built_for_the_user_and_not_written_into(sources: Path, cache: Path) -> None:
    before = sorted(sources.rglob("*"))
    built = build.library()
    assert built.parent == cache
    assert sorted(sources.rglob("*")) == before
    assert cache.stat().st_mode & 0o777 == 0o700
    stamp = built.stat().st_mtime_ns
    assert build.library() == built
    assert built.stat().st_mtime_ns == stamp


def test_a_compiled_library_that_was_brought_is_taken(
    sources: Path, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    brought = build.compile_all(sources)
    assert len(brought) == (2 if platform.machine() == "x86_64" else 1)
    monkeypatch.setenv("PATH", "")
    assert build.library() in brought
    monkeypatch.setattr(build, "_has_avx2", lambda: False)
    assert build.library() == brought[0]
    assert not cache.exists()


@pytest.mark.parametrize("mode", [0o720, 0o702, 0o777])
def test_a_cache_folder_that_others_write_into_is_refused(cache: Path, mode: int) -> None:
    """What lies there is executed."""
    cache.mkdir()
    cache.chmod(mode)
    with pytest.raises(ConfigError, match=r"that others can write into.*Next: `chmod go-w`"):
        build.library()
    assert not list(cache.iterdir())


def test_no_folder_to_build_in(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cache.parent.joinpath("file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache.parent / "file"))
    with pytest.raises(ConfigError, match=r"no folder to build it in.*XDG_CACHE_HOME"):
        build.library()


@pytest.mark.parametrize("named", ["", "relative/cache"])
def test_where_the_variable_names_no_absolute_path(
    cache: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, named: str
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", named)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert build.library().parent == tmp_path / "home/.cache/levbench"


def test_processes_that_start_at_once_all_load_it(sources: Path, cache: Path) -> None:
    """None of them sees half of a library: each builds its own, and one name takes them all."""
    ask = (
        "import ctypes, pathlib, sys; from sim_backend.core import build; here = pathlib.Path(sys.argv[1]);"
        "build.HERE, build.MACHINES, build.CLONE = here, here / 'machines', here / 'pyproject.toml';"
        "print(ctypes.CDLL(str(build.library())).one())"
    )
    started = [subprocess.Popen([sys.executable, "-c", ask, str(sources)], stdout=subprocess.PIPE) for _ in range(4)]
    assert [process.communicate()[0].strip() for process in started] == [b"1"] * 4
    assert len(os.listdir(cache)) == 1


def test_a_library_that_does_not_load_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = tmp_path / "core.so"
    broken.write_bytes(b"of another platform")
    monkeypatch.setattr(core, "library", lambda: broken)
    with pytest.raises(ConfigError, match=rf"cannot be loaded.*Next: remove {broken}"):
        core.open_core(Path(plant.__file__).with_name("tsbs.h"))


@pytest.mark.parametrize(("kind", "struct"), [(PlantParams, "tsbs_params"), (ControlParams, "tsbs_control")])
def test_every_field_of_the_header_has_a_default(kind: type, struct: str) -> None:
    declared = {name: field.type for name, field in plant._ffi.typeof(struct).fields}
    defaults = kind()
    assert set(declared) == {f.name for f in dataclasses.fields(kind)}
    for name, ctype in declared.items():
        value = getattr(defaults, name)
        assert (len(value) if isinstance(value, tuple) else None) == (ctype.length if ctype.kind == "array" else None)
