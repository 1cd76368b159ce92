"""The far end of a port: a pty, or a TCP server for tests that are parametrised by `end`."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from far_end import FarEnd, far_end


@pytest.fixture
def end(request: pytest.FixtureRequest) -> Iterator[FarEnd]:
    with far_end(getattr(request, "param", False)) as far:
        yield far
