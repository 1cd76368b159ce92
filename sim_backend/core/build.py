"""Builds the C core: a plain shared library of what is in this folder and in those of the machines, named by the digest of
what it is made from."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from bench.errors import ConfigError

HERE = Path(__file__).resolve().parent
MACHINES = HERE.with_name("machines")
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


def library() -> Path:
    """The built library; builds it when a source, a header or a flag has changed.

    Raises:
        ConfigError: there is no C compiler, or it fails; its output is in the message.
    """
    sources, headers = _files("*.c"), _files("*.h")
    flags = (*FLAGS, *AVX2) if _has_avx2() else FLAGS
    parts = [path.read_bytes() for path in (*sources, *headers)]
    digest = hashlib.sha256(b"\0".join([*parts, " ".join(flags).encode()])).hexdigest()[:16]
    target = HERE / f"{'core_avx2' if AVX2[0] in flags else 'core'}-{digest}.so"
    if not target.exists():
        _compile(sources, target, flags)
    return target


def _files(pattern: str) -> list[Path]:
    return [*sorted(HERE.glob(pattern)), *sorted(MACHINES.glob(f"*/{pattern}"))]


def _has_avx2() -> bool:
    """Whether this processor has AVX2, as far as the system tells."""
    try:
        return " avx2 " in Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace")
    except OSError:
        return False


def _compile(sources: list[Path], target: Path, flags: Sequence[str]) -> None:
    compiler = os.environ.get("CC") or next((c for c in ("cc", "gcc", "clang") if shutil.which(c)), None)
    if compiler is None:
        raise ConfigError("no C compiler found (looked for cc, gcc, clang); install one, or name it in CC")
    with tempfile.TemporaryDirectory(dir=HERE) as folder:
        made = Path(folder) / "core.so"
        command = [compiler, *flags, "-I", str(HERE), "-o", str(made), *map(str, sources), "-lm"]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        except OSError as error:
            raise ConfigError(f"the C compiler {compiler!r} (from CC) cannot be started: {error.strerror}") from error
        if done.returncode != 0:
            raise ConfigError(f"{compiler} could not build the simulator core:\n{done.stderr}")
        os.replace(made, target)
    kind = target.name.split("-")[0]  # processors of both kinds may share this directory
    for old in (*HERE.glob(f"{kind}-*.so"), *HERE.glob("tsbs-*.so")):
        if old != target:
            old.unlink(missing_ok=True)
