"""pytest with `-p suite_catalogue`: small procedures of which one needs another, and one needs what no rig has."""

from __future__ import annotations

from bench import catalogue

SMALL = (
    catalogue.Entry("tiny-levitated", "tests.tiny_procedures", "A look at the supply"),
    catalogue.Entry("tiny-needing", "tests.campaign_procedures", "Needs a look at the supply"),
    catalogue.Entry("tiny-lacking", "tests.lacking_procedure", "Needs a winch"),
)


def pytest_configure() -> None:
    catalogue.PROCEDURES = SMALL
