"""Building the C programs of this folder."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

HERE = Path(__file__).parent
FLAGS = ("-std=c99", "-O1", "-Wall", "-Wextra", "-pedantic", "-Werror")
SLY = ("-Dtake_message=obey_message", "-Dsend_message=say_message")
"""What the controller hears and says goes through mischief.c, which stands between it and the wire."""


def _compile(*arguments: str) -> None:
    compiler = os.environ.get("CC") or next(c for c in ("cc", "gcc", "clang") if shutil.which(c))
    subprocess.run([compiler, *FLAGS, *arguments], check=True)


def firmware(folder: Path) -> Path:
    """The example of the protocol page."""
    made = folder / "firmware"
    _compile("-o", str(made), *(str(HERE / name) for name in ("firmware.c", "controller.c", "wire.c")), "-lm")
    return made


def line(folder: Path) -> Path:
    """The controller with a command line, written from the page of its protocol alone."""
    made = folder / "line"
    _compile("-o", str(made), *(str(path) for path in sorted((HERE / "line").glob("*.c"))), "-lm")
    return made


def mischief(folder: Path) -> Path:
    """The same controller with a plant that carries masses, and with misbehaviours."""
    made, controller = folder / "mischief", folder / "controller.o"
    _compile(*SLY, "-c", "-o", str(controller), str(HERE / "controller.c"))
    sources = (str(HERE / name) for name in ("mischief.c", "spoiled.c", "rotor.c", "wire.c"))
    _compile("-o", str(made), str(controller), *sources, "-lm")
    return made
