"""The reader of DBC files is cantools' own, however it is imported."""

from __future__ import annotations

import subprocess
import sys

import pytest

HERE = "import bench.rigfile.dbcreader as ours"
THERE = "import cantools, cantools.tester"
SAME = "assert cantools.database is ours.database and cantools.tester.MessageCls is ours.database.Message"


@pytest.mark.parametrize("order", [(HERE, THERE), (THERE, HERE)])
def test_whoever_imports_cantools_has_the_same_one(order: tuple[str, str]) -> None:
    code = "; ".join(["import sys", *order, SAME, "print(sys.modules['cantools'].__file__)"])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip().endswith("cantools/__init__.py")


def test_reading_brings_neither_python_can_nor_the_rest_of_cantools() -> None:
    seen = "print(*{'can', 'cantools', 'cantools.tester'} & sys.modules.keys())"
    code = f"import sys; {HERE}; ours.database.load_string('VERSION \"\"', 'dbc'); {seen}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
