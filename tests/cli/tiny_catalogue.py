"""The command `bench`, and pytest with `-p tiny_catalogue`, with the tests' small procedure in the catalogue."""

from __future__ import annotations

import sys

from bench import catalogue
from bench.cli.__main__ import main

TINY = (catalogue.Entry("tiny-levitated", "tests.tiny_procedures", "A look at the supply"),)


def pytest_configure() -> None:
    catalogue.PROCEDURES = TINY


if __name__ == "__main__":
    catalogue.PROCEDURES = TINY
    sys.exit(main())
