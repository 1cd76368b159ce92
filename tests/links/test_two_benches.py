"""A rig belongs to one bench: the second is told whose it is and since when, on this host and from another one."""

from __future__ import annotations

from pathlib import Path

import processes
import pytest


@pytest.mark.long
def test_the_second_bench_is_refused_by_the_owners_name(tmp_path: Path) -> None:
    with processes.served(tmp_path) as rig:
        first = processes.live(rig, "slcan:socket", "tiny-levitated", "--no-report", "--plan", 'act="count"')
        with processes.bench(tmp_path, *first) as owner:
            owner.wait_for("at ")
            number = owner.process.pid
            with processes.bench(tmp_path, *first) as second:  # the same address: the lock of this host
                assert second.end() == 2
            assert f"process {number}" in second.err[-1]
            assert "since 20" in second.err[-1]
            # Another address of the same controller, as another host has it: the controller knows its owner.
            other = processes.live(rig, "serial:socket", "tiny-levitated", "--no-report")
            with processes.bench(tmp_path, *other) as second:
                assert second.end() == 2
            assert f"process {number}" in " ".join(second.err)
            assert "since 20" in " ".join(second.err)
            assert owner.process.poll() is None
            assert rig.state_lines()[-1].endswith("-> LEVITATED")
            owner.process.terminate()
            assert owner.end() == 4
            assert len(list(tmp_path.glob("runs/*/record.json"))) == 1
