"""Where the command `bench` begins. From here on Ctrl-C ends in a line and in status 4, also while modules are loaded."""

from __future__ import annotations

import sys
from collections.abc import Sequence

ABORTED = 4


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit status."""
    try:
        given = sys.argv[1:] if arguments is None else arguments
        if given[:1] == ["_complete"]:  # a key was pressed: no command line need be understood
            from bench.cli.completing import complete

            return complete(given[1:])
        if given[:1] in (["runs"], ["trend"]):
            from bench.cli.plain import plain

            if (act := plain(given)) is not None:
                from bench.cli.status import ended

                return ended(act)
        from bench.cli.__main__ import main as run

        return run(arguments)
    except KeyboardInterrupt:
        sys.stderr.write("bench: stopped\n")
        return ABORTED
