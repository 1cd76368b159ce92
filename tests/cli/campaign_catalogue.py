"""The command `bench` with the tests' small procedures for campaigns in the catalogue."""

from __future__ import annotations

import sys

from bench import catalogue
from bench.cli.__main__ import main

SMALL = (
    catalogue.Entry("tiny-levitated", "tests.tiny_procedures", "A look at the supply"),
    catalogue.Entry("tiny-needing", "tests.campaign_procedures", "Needs a look at the supply"),
    catalogue.Entry("tiny-resting", "tests.campaign_resting", "A look at the supply, at rest"),
)


if __name__ == "__main__":
    catalogue.PROCEDURES = SMALL
    sys.exit(main())
