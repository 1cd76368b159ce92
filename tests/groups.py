"""Which tests run one after the other on one of xdist's workers, by their node ids.

`@pytest.mark.xdist_group` would say the same, but pytest-xdist 3.8 hands a mark over inside the node id, which pytest 9.2 does
not let it change: the marks are ignored without a word (pytest-xdist issue 1386).
"""

from __future__ import annotations

import os
from typing import Any

REAL_TIME, PATIENT = "real-time", "patient"
GROUPS = {
    # They wait for minutes, take a third of a core, and their watchdogs have seconds: one after the other beside REAL_TIME.
    PATIENT: ("tests/links/test_chain.py", "tests/links/test_continued_served.py", "tests/links/test_live_one_axis.py",
              "tests/links/test_live_runup.py", "tests/links/test_live_lift_off.py"),
    # Their processes keep up with wall time, and mostly wait: one after the other, for two at once were too many beside others.
    REAL_TIME: ("tests/links/", "tests/firmware/", "tests/cli/test_serve.py", "tests/drivers/test_heartbeat",
                "tests/drivers/test_live_link.py", "tests/drivers/test_fieldbus_live.py",
                "test_docs.py::test_commands_work[serve-a-rig]", "test_docs.py::test_commands_work[connect-a-rig]",
                "test_docs.py::test_commands_work[connect-a-stage]", "test_docs.py::test_commands_work[add-a-device]"),
    # They begin with the same calibrations, which are made once.
    "identified": ("tests/procedures/test_amb_calibration.py", "tests/procedures/test_amb_facts.py",
                   "tests/procedures/test_force_constant.py", "tests/procedures/test_force_coupling.py",
                   "tests/procedures/test_force_map.py", "tests/procedures/test_negative_stiffness.py",
                   "tests/procedures/test_first_look.py"),
    # Their pages begin with the same commands, which are executed once.
    "chained pages": ("test_docs.py::test_commands_work[force-constant]",
                      "test_docs.py::test_commands_work[force-coupling]",
                      "test_docs.py::test_commands_work[force-map]",
                      "test_docs.py::test_commands_work[lift-off]",
                      "test_docs.py::test_commands_work[negative-stiffness]"),
}  # fmt: skip
COMPUTED = ("tests/links/test_own_controller.py", "tests/links/test_bound_rig.py::test_a_calibration",
            "tests/links/test_protection_trips.py::test_each_protected_reading_trips")  # fmt: skip
"""In the rooms of links, and in one process: their clock is simulated, and they keep up with nothing."""
PAGES = "tests/test_docs.py::test_commands_work"
"""Long tests of one file that share nothing: each goes to whichever worker is free."""

FIRST = (REAL_TIME, PATIENT, "tests/test_machines.py", "tests/procedures/test_loop_response.py",
         "tests/procedures/test_coverage_long.py", "tests/procedures/test_coil_map.py", "tests/test_described.py",
         "tests/test_renamed_rigs.py", "tests/live/test_live_requests.py", "tests/procedures/test_moved_long.py",
         "tests/procedures/test_maximum_speed.py", "tests/procedures/test_estimator_compare.py", "tests/test_wheel.py",
         "tests/procedures/test_load_response_run.py", "tests/test_docs.py", f"{PAGES}[model]", "tests/test_honest_hour.py",
         "tests/cli/test_example_package.py", "tests/procedures/test_bearing_constant.py",
         "tests/cli/test_campaign_dask.py", "tests/test_golden_numbers.py", f"{PAGES}[lira]")  # fmt: skip
"""What takes longest is handed out first, or one worker ends long after the others."""
NICE = 10  # of workers that only compute: those that must keep up with wall time find a free processor whenever they need one


def group_of(nodeid: str) -> str:
    """The group's name; where there is none the file, whose fixtures are then made by one worker only."""
    whole = nodeid if nodeid.startswith(PAGES) else nodeid.partition("::")[0]
    if nodeid.startswith(COMPUTED):
        return whole
    return next((name for name, parts in GROUPS.items() if any(part in nodeid for part in parts)), whole)


def scheduler(config: Any, log: Any) -> Any:
    """Hands out groups whole: those in real time, what takes longest, then those with the most tests."""
    from xdist.scheduler import LoadScopeScheduling

    class ByGroup(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return group_of(nodeid)

        def _assign_work_unit(self, node: Any) -> None:
            if waiting := [name for name in FIRST if name in self.workqueue]:
                self.workqueue.move_to_end(waiting[0], last=False)
            super()._assign_work_unit(node)

    return ByGroup(config, log)


def give_way(nodeid: str) -> None:
    """Before a test on a worker among several: what only computes lets those go first that must keep up with wall time. There
    is no way back for this worker, which is why their groups are handed out before all others."""
    if "PYTEST_XDIST_WORKER" in os.environ and hasattr(os, "nice") and group_of(nodeid) not in (REAL_TIME, PATIENT):
        os.nice(max(NICE - os.nice(0), 0))
