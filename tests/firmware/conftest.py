"""The C program, built once for all tests of it."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

SOURCE = Path(__file__).parent / "firmware.c"


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if os.name != "posix":
        pytest.skip("the program needs POSIX")
    made = tmp_path_factory.mktemp("firmware") / "firmware"
    compiler = os.environ.get("CC") or next(c for c in ("cc", "gcc", "clang") if shutil.which(c))
    subprocess.run([compiler, "-std=c99", "-O1", "-Wall", "-Wextra", "-pedantic", "-Werror", "-o", str(made), str(SOURCE),
                    "-lm"], check=True)  # fmt: skip
    return made
