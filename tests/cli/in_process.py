"""`bench` in the process of the tests."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from bench.cli.__main__ import main

Bench = Callable[..., tuple[int, str, str]]


def bench_in_process(capsys: pytest.CaptureFixture[str]) -> Bench:
    """A command by its arguments: exit status, standard output, standard error; never a traceback."""

    def command(*arguments: str) -> tuple[int, str, str]:
        status = main(arguments)
        out, err = capsys.readouterr()
        assert "Traceback" not in out + err
        return status, out, err

    return command
