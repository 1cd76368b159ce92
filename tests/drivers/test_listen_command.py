"""`bench listen` against devices that answer wrongly, and its recording."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from far_end import Adapter, far_end

from bench.cli.__main__ import main
from bench.recording import Recording

OPENING = b"\r\rC\rV\r" + b"S8\rY5\rV\r" + b"L\rV\r"
TELEMETRY = b"b100F" + b"".join(b"%02X" % (k % 251) for k in range(64)) + b"\r"
HOSTILE = (
    b"\xff\x00garbage\r" * 5
    + b"b100E" + b"00" * 48 + b"\r"  # another length than the DBC's
    + b"t3A0201FF\r" * 7 + b"T0001ABCD100\r"  # strangers
    + b"t100" + b"\r" + b"tXYZ2\r"
    + TELEMETRY * 30  # both counters stand
)  # fmt: skip
Listened = tuple[int, list[str], str]


class Opened(Adapter):
    """An adapter that lets go of `sent` when it is opened."""

    def __init__(self, sent: bytes) -> None:
        super().__init__()
        self._sent = sent

    def _line(self, line: bytes) -> bytes:
        return super()._line(line) + (self._sent if line == b"L" else b"")


@pytest.fixture
def listen(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[..., Listened]:
    monkeypatch.chdir(tmp_path)

    def command(url: str, *arguments: str) -> Listened:
        status = main(("listen", "tsbs12", "--link", f"controller={url}", "--seconds", "1.2", *arguments))
        out, err = capsys.readouterr()
        assert "Traceback" not in out + err
        return status, out.splitlines(), err

    return command


def test_a_hostile_device_is_described_and_hears_nothing_but_its_opening(listen: Callable[..., Listened]) -> None:
    with far_end(False, Opened(HOSTILE)) as end:
        status, out, err = listen(f"slcan:{end.where}")
        end.wait_for(OPENING + b"C\r")
        assert end.received == OPENING + b"C\r"
    text = " ".join(" ".join(out).split())
    assert status == 0
    assert "nothing is sent; Ctrl-C ends" in err
    assert "drive, supply, thermal: not read, as reading registers is a request; --poll reads them" in err
    assert "Telemetry (0x100): 1 frames of 48 bytes, the DBC says 64" in text
    assert "pieces of the byte stream are no message" in text
    assert "2 identifiers that the DBC does not know: 0x3A0 (7, " in text
    assert "0x0001ABCD (1, " in text
    assert "how listen-only (L): the adapter acknowledges nothing" in text
    assert [x for x in out if x.startswith("  unknown")]
    assert [x for x in out if x.startswith("  pos_xi")]


def test_a_recording_is_kept_and_exported(listen: Callable[..., Listened], capsys: pytest.CaptureFixture[str]) -> None:
    with far_end(False, Opened(TELEMETRY * 3)) as end:
        status, out, _ = listen(f"slcan:{end.where}", "--record", "--out", "heard")
    assert status == 0
    directory = Path(out[-1])
    assert directory.parent == Path("heard")
    recording = Recording.open(directory / "recording.mcap")  # type: ignore[var-annotated]
    assert sum(len(batch) for batch in recording.frames("controller")) == 3
    assert recording.rig.name == "tsbs12"
    assert not recording.truncated
    for to, name in (("csv", "telemetry.csv"), ("candump", "controller.log"), ("parquet", "telemetry.parquet")):
        assert main(("export", str(directory), "--to", to)) == 0
        assert (directory / "export" / name).stat().st_size > 100
    assert main(("runs", "--out", "heard")) == 0
    assert capsys.readouterr().err == "no runs in heard\n"
    assert main(("analyse", str(directory))) == 2
    assert "recorded by `bench listen`, which measures nothing. Next: `bench export`" in capsys.readouterr().err


def test_nothing_that_comes_is_an_error_where_a_time_was_asked_for(listen: Callable[..., Listened]) -> None:
    with far_end(False, Adapter()) as end:
        status, out, _ = listen(f"slcan:{end.where}")
    text = " ".join(" ".join(out).split())
    assert status == 3
    assert f"nothing comes over slcan:{end.where}. Next: is the controller switched on" in text
    assert "--acknowledge" in text
    assert "state never came" in text


def test_a_link_that_is_lost_ends_it_with_the_summary(listen: Callable[..., Listened]) -> None:
    with far_end(True, Opened(TELEMETRY)) as end:
        hang_up = threading.Thread(target=lambda: (end.wait_for(b"L\rV\r"), end.hang_up()))
        hang_up.start()
        status, out, err = listen(f"slcan:{end.where}", "--seconds", "60")
        hang_up.join()
    assert status == 3
    assert "its other end closed" in err
    assert out[0].startswith("tsbs12: listened") or any(x.startswith("tsbs12: listened") for x in out)


def test_a_port_in_use_is_told_with_its_owner(listen: Callable[..., Listened]) -> None:
    with far_end(False, Opened(TELEMETRY)) as end:
        holder = "import fcntl, sys; f = open(sys.argv[1]); fcntl.flock(f, fcntl.LOCK_EX); print('held', flush=True); input()"
        with subprocess.Popen(
            [sys.executable, "-c", holder, end.where], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        ) as other:
            assert other.stdout is not None
            assert other.stdout.readline() == b"held\n"
            status, _, err = listen(f"slcan:{end.where}")
            other.communicate(b"\n")
        assert end.received == b""
    assert status == 2
    assert f"it is in use by process {other.pid}" in err


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("slcan:/dev/ttyNOWHERE", "found no such device"),
        ("serial:/dev/ttyNOWHERE", "found no such device"),
        ("slcan:socket://127.0.0.1:9", "nobody listens there; start `bench serve`"),
        ("inprocess:", "where nothing can be listened to"),
        ("can:nosuch:can0", "expected one of"),
    ],
)
def test_what_cannot_be_opened_is_a_usage_error(listen: Callable[..., Listened], url: str, said: str) -> None:
    status, _, err = listen(url)
    assert status == 2
    assert said in err
