"""The command `bench` with the tests' small procedure of a stage in the catalogue."""

from __future__ import annotations

import sys

from bench import catalogue
from bench.cli.__main__ import main

if __name__ == "__main__":
    catalogue.PROCEDURES = (catalogue.Entry("tiny-stage", "tests.stage_procedure", "A look at an axis"),)
    sys.exit(main())
