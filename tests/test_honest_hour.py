"""An hour of 30 channels at 1 kHz: it opens and is analysed in less than 1 GB, whole or cut off."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from recordings import HEADER, START_NS, SetClock

from bench.link.frames import FD, FRAME
from bench.recording.recorder import Recorder
from bench.samples import ChannelInfo, SampleBlock, StreamLayout

HOUR_S = 3600
MS = 1_000_000
CHANNELS = tuple(ChannelInfo(f"x{k}", "m") for k in range(27)) + tuple(ChannelInfo(n, "1", "u2") for n in "abc")
READ = """
import sys
from pathlib import Path
from bench.recording import Recording
r = Recording.open(Path(sys.argv[1]))
steps = r.steps("dwell")
means = [step.mean("x3") for step in steps]
lost = [step.lost() for step in steps]
whole = r.read(("x0", "x1", "x2", "x3", "a"), 0, 1 << 62)
frames = sum(len(batch) for batch in r.frames("controller"))
print(r.truncated, len(means), sum(lost), len(whole["x0"]), frames)
# Not ru_maxrss: that starts from the peak of the process that forked this one.
print(next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM:")))
"""


def an_hour(path: Path) -> None:
    """A step each second; numbers and payloads are noise, which lz4 cannot make smaller."""
    rng = np.random.default_rng(0)
    stream = StreamLayout("telemetry", MS, CHANNELS)
    columns = {
        c.name: rng.standard_normal(1000) if c.dtype == "f4" else rng.integers(0, 8, 1000) * 1.0 for c in CHANNELS
    }
    frames = np.zeros(1000, FRAME)
    frames["id"], frames["flags"], frames["length"] = 0x100, FD, 64
    frames["data"] = rng.integers(0, 256, (1000, 64), np.uint8)
    clock = SetClock()
    with Recorder(path, clock=clock, streams=[stream], header=HEADER) as recorder:
        for second in range(HOUR_S):
            index = np.arange(second * 1000, second * 1000 + 1000)
            t_ns = START_NS + index * MS
            frames["t_ns"] = t_ns
            with recorder.step("dwell", number=second):
                for k in range(0, 1000, 100):
                    recorder.frames("controller", frames[k : k + 100])
                recorder.samples(
                    SampleBlock(
                        "telemetry", second * 1000, (index * 10).astype(np.uint64), t_ns, int(t_ns[-1]), 0, columns
                    )
                )
                clock.now = int(t_ns[-1]) + MS


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_an_hour_of_thirty_channels_is_read_in_less_than_a_gigabyte(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    an_hour(path)
    size = path.stat().st_size
    assert size > 500e6
    for cut in (False, True):
        if cut:
            with path.open("r+b") as file:
                file.truncate(size - 10_000_000)
        done = subprocess.run([sys.executable, "-c", READ, str(path)], capture_output=True, text=True, check=True)
        said, memory = done.stdout.splitlines()
        truncated, steps, lost, samples, frames = said.split()
        assert (truncated, lost) == (str(cut), "0")
        assert int(memory) < 1_000_000  # kB
        if cut:
            assert HOUR_S - 60 <= int(steps) < HOUR_S
            assert int(samples) > 3.5e6
        else:
            assert (int(steps), int(samples), int(frames)) == (HOUR_S, 3_600_000, 3_600_000)
