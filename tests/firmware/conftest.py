"""The C programs, built once for all tests of them."""

from __future__ import annotations

import os
from pathlib import Path

import c_programs
import line_programs
import pytest


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if os.name != "posix":
        pytest.skip("the program needs POSIX")
    return c_programs.firmware(tmp_path_factory.mktemp("firmware"))


@pytest.fixture(scope="session")
def mischief(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if os.name != "posix":
        pytest.skip("the program needs POSIX")
    return c_programs.mischief(tmp_path_factory.mktemp("mischief"))


@pytest.fixture(scope="session")
def line_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if os.name != "posix":
        pytest.skip("the program needs POSIX")
    return c_programs.line(tmp_path_factory.mktemp("line"))


@pytest.fixture(scope="session")
def rig_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Rig files for it: lira as it is, and one based on it for the dialect."""
    return line_programs.rigs_in(tmp_path_factory.mktemp("rigs"))
