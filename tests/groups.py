"""Which tests run one after the other on one of xdist's workers, by their node ids.

`@pytest.mark.xdist_group` would say the same, but pytest-xdist 3.8 hands a mark over inside the node id, which pytest 9.2 does
not let it change: the marks are ignored without a word (pytest-xdist issue 1386).
"""

from __future__ import annotations

from typing import Any

GROUPS = {
    # Their processes keep up with wall time.
    "real-time": ("tests/links/test_captures.py", "tests/links/test_chain.py", "tests/links/test_killed.py",
                  "tests/links/test_live_run.py",
                  "tests/links/test_two_benches.py", "tests/links/test_unplug.py", "tests/firmware/",
                  "tests/cli/test_serve.py", "tests/drivers/test_heartbeat", "tests/drivers/test_live_link.py",
                  "tests/drivers/test_fieldbus_live.py", "test_docs.py::test_commands_work[serve-a-rig]",
                  "test_docs.py::test_commands_work[connect-a-rig]", "test_docs.py::test_commands_work[add-a-device]"),
    # They begin with the same calibrations, which are made once.
    "identified": ("tests/procedures/test_amb_calibration.py", "tests/procedures/test_amb_facts.py",
                   "tests/procedures/test_force_constant.py", "tests/procedures/test_force_coupling.py",
                   "tests/procedures/test_force_map.py", "tests/procedures/test_negative_stiffness.py",
                   "tests/procedures/test_first_look.py"),
    # Their pages begin with the same commands, which are executed once.
    "chained pages": ("test_docs.py::test_commands_work[force-constant]",
                      "test_docs.py::test_commands_work[force-coupling]",
                      "test_docs.py::test_commands_work[force-map]",
                      "test_docs.py::test_commands_work[negative-stiffness]"),
}  # fmt: skip
ALONE = ("tests/test_docs.py::test_commands_work",)
"""Long tests of one file that share nothing: each goes to whichever worker is free."""


def group_of(nodeid: str) -> str:
    """The group's name; where there is none the file, whose fixtures are then made by one worker only."""
    whole = nodeid if nodeid.startswith(ALONE) else nodeid.partition("::")[0]
    return next((name for name, parts in GROUPS.items() if any(part in nodeid for part in parts)), whole)


def scheduler(config: Any, log: Any) -> Any:
    """Hands out groups whole, those with the most tests first."""
    from xdist.scheduler import LoadScopeScheduling

    class ByGroup(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return group_of(nodeid)

    return ByGroup(config, log)
