"""The cable is pulled in each phase of a run: the run ends with the link's name and the rig lands alone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import processes
import pytest
from cable import Cable
from processes import Served

PHASES = {
    "lifting": "bring the rig to",
    "first step": "step 1/2",
    "second step": "step 2/2",
    "make safe": "make safe",
}


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with processes.served(tmp_path_factory.mktemp("rig")) as served:
        yield served


def phases() -> list[object]:
    """The default run pulls it once."""
    return [pytest.param(p, marks=() if p == "first step" else pytest.mark.long) for p in PHASES]


@pytest.mark.parametrize("phase", phases())
def test_unplugged_in(phase: str, tmp_path: Path, rig: Served) -> None:
    before = len(rig.child.err)
    processes.patient_rig(tmp_path)
    with Cable(rig.endpoints["slcan:socket"]) as cable:
        port = ("--link", f"controller=slcan:{cable.path}")
        arguments = processes.live(rig, "slcan:socket", "tiny-levitated", "--no-report", *port)
        with processes.bench(tmp_path, *arguments) as child:
            child.wait_for(PHASES[phase])
            rig.child.wait_for("-> LIFTING", before)  # before it there is nothing to land
            cable.pull()
            assert child.end() == 3, child.err
            record = processes.record_in(tmp_path, child)
    rig.child.wait_for("-> FAULT", before)
    codes = [f["code"] for f in record["findings"]]
    assert record["outcome"] == "ERROR"
    assert "make-safe-failed" in codes, record["findings"]
    if phase != "make safe":
        assert codes[0] == "link-lost"
        assert "unplugged" in record["findings"][0]["text"]


@pytest.mark.long
def test_unplugged_while_it_opens(tmp_path: Path, rig: Served) -> None:
    processes.patient_rig(tmp_path)
    with Cable(rig.endpoints["slcan:socket"]) as cable:
        port = ("--link", f"controller=slcan:{cable.path}")
        arguments = processes.live(rig, "slcan:socket", "tiny-levitated", "--no-report", *port)
        with processes.bench(tmp_path, *arguments) as child:
            assert cable.used.wait(processes.LINE_S)
            cable.pull()
            assert child.end() in (2, 3)
    assert not list(tmp_path.glob("runs/*"))
    assert "Traceback" not in "\n".join(child.err)
    assert "unplugged" in child.err[-1]
