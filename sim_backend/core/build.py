"""Finds the C core, or builds it: a plain shared library of what is in this folder and in those of the machines, named by the
digest of what it is made from.

A wheel brings it, compiled, in this folder. In a clone it is built here, and again when a source changes. Else it is built
once into the user's cache folder: an installed package is not written into.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from bench.errors import ConfigError

HERE = Path(__file__).resolve().parent
MACHINES = HERE.with_name("machines")
CLONE = HERE.parents[1] / "pyproject.toml"
FLAGS = (
    "-std=c11",
    "-O3",
    "-flto",
    "-fno-semantic-interposition",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-ffp-contract=off",
    "-fPIC",
    "-shared",
    "-Wall",
    "-Wextra",
)
# -O3: loops over axes and coils become vector operations, which round like single ones: the same bytes.
# -ffp-contract=off: no fused multiply-add, so that the same seed gives the same bytes on every processor.
AVX2 = ("-mavx2",)
# Vectors of four numbers instead of two, where the processor has them: a fifth less time, and the same bytes again.
WITH_AVX2 = ("x86_64", "AMD64", "amd64")  # machines that some processors with AVX2 are of
COMPILERS = ("cc", "gcc", "clang")
NEXT = (
    "Next: install Levbench from a wheel for this platform, which has it compiled, or install a C compiler "
    "(Debian, Ubuntu: apt install gcc), or name one in CC"
)


def library() -> Path:
    """The compiled library for this processor; builds it where there is none of these sources, headers and flags.

    Raises:
        ConfigError: there is no C compiler, it fails (its output is in the message), or no folder can take what it makes.
    """
    flags = (*FLAGS, *AVX2) if _has_avx2() else FLAGS
    name = _name(flags)
    if (shipped := HERE / name).exists():
        return shipped
    folder = HERE if CLONE.is_file() and os.access(HERE, os.W_OK) else _cache()
    target = folder / name
    if not target.exists():
        _compile(target, flags)
        if folder == HERE:
            _remove_older(target)
    return target


def compile_all(folder: Path) -> list[Path]:
    """Build what a wheel for this platform brings into a folder: the library for every processor, and the one for AVX2.

    Raises:
        ConfigError: as for `library`.
    """
    kinds = (FLAGS, (*FLAGS, *AVX2)) if platform.machine() in WITH_AVX2 else (FLAGS,)
    targets = [folder / _name(flags) for flags in kinds]
    for target, flags in zip(targets, kinds, strict=True):
        _compile(target, flags)
    return targets


def _name(flags: Sequence[str]) -> str:
    parts = [path.read_bytes() for path in (*_files("*.c"), *_files("*.h"))]
    digest = hashlib.sha256(b"\0".join([*parts, " ".join(flags).encode()])).hexdigest()[:16]
    return f"{'core_avx2' if AVX2[0] in flags else 'core'}-{digest}.so"


def _files(pattern: str) -> list[Path]:
    return [*sorted(HERE.glob(pattern)), *sorted(MACHINES.glob(f"*/{pattern}"))]


def _has_avx2() -> bool:
    """Whether this processor has AVX2, as far as the system tells."""
    try:
        return " avx2 " in Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace")
    except OSError:
        return False


def _cache() -> Path:
    """The user's folder for what can be made again, `$XDG_CACHE_HOME/levbench`, after the XDG Base Directory Specification 0.8:
    `~/.cache` where the variable is not set or no absolute path.

    Raises:
        ConfigError: it cannot be made, or others may write into it: what lies there is executed.
    """
    named = Path(os.environ.get("XDG_CACHE_HOME", ""))
    folder = (named if named.is_absolute() else Path(os.path.expanduser("~/.cache"))) / "levbench"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        state = folder.stat()
    except OSError as error:
        raise ConfigError(
            f"the simulator's core is not compiled here, and there is no folder to build it in: {folder}: "
            f"{error.strerror}; expected one that can be written. {NEXT}, and a folder in XDG_CACHE_HOME"
        ) from error
    if hasattr(os, "getuid") and (state.st_uid != os.getuid() or state.st_mode & 0o022):
        raise ConfigError(
            f"cache folder {folder}: found one that is another user's or that others can write into; expected one of "
            "your own, since what lies there is executed. Next: `chmod go-w` it, or name another in XDG_CACHE_HOME"
        )
    return folder


def _compiler() -> str:
    found = os.environ.get("CC") or next((c for c in COMPILERS if shutil.which(c)), None)
    if found is None:
        raise ConfigError(
            f"the simulator's core is not compiled for this machine ({platform.machine()}), and no C compiler found "
            f"(looked for {', '.join(COMPILERS)}). {NEXT}"
        )
    return found


def _compile(target: Path, flags: Sequence[str]) -> None:
    """Build the library beside its final name first: processes that start at once never see half of one."""
    compiler = _compiler()
    try:
        work = tempfile.TemporaryDirectory(dir=target.parent)
    except OSError as error:
        raise ConfigError(
            f"the simulator's core cannot be built in {target.parent}: {error.strerror}. {NEXT}"
        ) from error
    with work as folder:
        made = Path(folder) / "core.so"
        command = [compiler, *flags, "-I", str(HERE), "-o", str(made), *map(str, _files("*.c")), "-lm"]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        except OSError as error:
            raise ConfigError(f"the C compiler {compiler!r} (from CC) cannot be started: {error.strerror}") from error
        if done.returncode != 0:
            raise ConfigError(f"{compiler} could not build the simulator core:\n{done.stderr}")
        os.replace(made, target)


def _remove_older(target: Path) -> None:
    kind = target.name.split("-")[0]  # processors of both kinds may share this directory
    for old in (*HERE.glob(f"{kind}-*.so"), *HERE.glob("tsbs-*.so")):
        if old != target:
            old.unlink(missing_ok=True)
