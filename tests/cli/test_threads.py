"""Linear algebra takes one thread in a command, unless the user says how many."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from bench.cli import threads

LOOK = """
import json, os, sys
from bench.cli.__main__ import main
before = set(sys.modules)
main(["list"])
print(json.dumps([dict(os.environ), "numpy" in before]))
"""


@pytest.mark.parametrize(("given", "told"), [({}, "1"), ({"OPENBLAS_NUM_THREADS": "3"}, "3")])
def test_a_command_takes_one_thread_unless_it_is_told(given: dict[str, str], told: str) -> None:
    own = {name: value for name, value in os.environ.items() if name not in threads.LIMITS}
    done = subprocess.run([sys.executable, "-c", LOOK], env=own | given, text=True, capture_output=True, check=True)
    found, numpy_was_there = json.loads(done.stdout.splitlines()[-1])
    assert [found[name] for name in threads.LIMITS] == ["1", told, "1"]
    assert not numpy_was_there  # it reads the limits when it is imported
