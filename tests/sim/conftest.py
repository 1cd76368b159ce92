"""Ports of the served rig, closed after each test."""

from __future__ import annotations

import selectors
from collections.abc import Iterator

import pytest

from sim_backend.serving.ports import Port


@pytest.fixture
def selector() -> Iterator[selectors.BaseSelector]:
    with selectors.DefaultSelector() as made:
        yield made


@pytest.fixture
def opened() -> Iterator[list[Port]]:
    ports: list[Port] = []
    yield ports
    for port in ports:
        port.close()
