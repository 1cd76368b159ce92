"""The example package, installed as users would, in a folder outside the clone: listed, run, reported, collected by pytest."""

from __future__ import annotations

import json
import os
import re
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from packages import install

from bench.errors import ConfigError, LinkError
from bench.link import LinkStats
from bench.rigfile.registers import RegisterRefused

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "extension"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the rig file, its limits, and in `site` the package, installed without network."""
    made = tmp_path_factory.mktemp("lab")
    source = shutil.copytree(EXAMPLE, made / "source")
    for part in ("rigs", "specs"):
        (source / part).rename(made / part)
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*pip, "--target", str(made / "site"), str(source)], check=True, capture_output=True)
    shutil.rmtree(source)
    install(made / "site", "levbench-installed", {"pytest11": {"levbench": "bench.cli.pytest_plugin"}}, {})
    return made


def python(folder: Path, *arguments: str) -> tuple[int, str, str]:
    """A module of Python as a process in that folder: exit status, standard output, standard error."""
    paths = os.pathsep.join([str(folder / "site"), str(ROOT)])
    done = subprocess.run([sys.executable, "-m", *arguments], cwd=folder, env={**os.environ, "PYTHONPATH": paths}, text=True,
                          capture_output=True, check=False)  # fmt: skip
    assert "Traceback" not in done.stderr
    return done.returncode, done.stdout, done.stderr


def test_it_is_listed_run_reported_and_analysed(folder: Path) -> None:
    status, out, err = python(folder, "bench.cli", "list")
    assert (status, err) == (0, "")
    assert re.search(r"coil-constant +of the package levbench-ball 0\.1\.0", out)
    assert "ball           A ball under a magnet" in out
    status, out, err = python(folder, "bench.cli", "run", "coil-constant", "--rig", "ball", "--seed", "3")
    assert status == 0, err
    run = folder / out.splitlines()[-1]
    record, truth = (json.loads((run / f"{name}.json").read_text()) for name in ("record", "truth"))
    (found,) = record["measurements"]
    assert abs(found["value"] - truth["quantities"]["C"]) < found["expanded_uncertainty"]
    assert (found["verdict"], record["versions"]["levbench-ball"]) == ("pass", "0.1.0")
    html = (run / "report.html").read_text()
    assert "The ball is held at several heights" in html
    assert "Current over height" in html
    assert "levbench-ball" in html
    status, _, err = python(folder, "bench.cli", "analyse", str(run))
    assert status == 0, err


def test_pytest_collects_it(folder: Path) -> None:
    status, out, _ = python(
        folder, "pytest", "-p", "no:cacheprovider", "--rig", "ball", "--no-report", "-k", "coil-constant"
    )
    assert (status, "1 passed" in out) == (0, True), out


@pytest.mark.long
def test_a_bent_line_is_no_result(folder: Path) -> None:
    status, _, err = python(folder, "bench.cli", "run", "coil-constant", "--rig", "ball", "--no-report", "--truth",
                            "saturation=0.05")  # fmt: skip
    assert status == 5, err
    assert "line-curved" in err


@pytest.mark.long
def test_a_sensor_the_wrong_way_round_does_not_come_up(folder: Path) -> None:
    status, _, err = python(folder, "bench.cli", "run", "coil-constant", "--rig", "ball", "--no-report", "--truth",
                            "position_sign=-1")  # fmt: skip
    assert status == 4, err


def test_its_codes_are_in_its_register(folder: Path) -> None:
    status, _, err = python(folder, "bench.cli.findings_page", "codes.md", "levbench_ball")
    assert status == 0, err
    page = (folder / "codes.md").read_text()
    assert "| `line-curved` | levbench ball | indeterminate |" in page
    assert "`rotor-not-arrived`" not in page


@pytest.mark.long
def test_its_intervals_hold_the_truth(folder: Path) -> None:
    """15 virtual rigs: at 95 % fewer than 10 hits have a chance below 1e-4, as the binomial distribution has it."""
    (folder / "ball-coverage.toml").write_text(
        'schema = 1\nname = "ball-coverage"\ntitle = "Does the interval hold the truth?"\nrig = "ball"\n'
        '[virtual]\ncount = 15\nfirst_seed = 0\n[[step]]\nprocedure = "coil-constant"\n'
    )
    status, out, err = python(folder, "bench.cli", "campaign", "ball-coverage.toml", "--no-report", "--jobs", "1")
    assert status in (0, 5), err + out  # so few rigs leave the campaign's own bands undecided
    lines = [json.loads(line) for line in (folder / out.splitlines()[-1] / "journal.jsonl").read_text().splitlines()]
    values = [v for line in lines if line["kind"] == "rig" for v in line["values"]]
    assert len(values) == 15
    assert sum(v["low"] <= v["truth"] <= v["high"] for v in values) >= 10


@contextmanager
def instrument(answers: dict[bytes, bytes]) -> Iterator[int]:
    """An instrument that answers questions of one host after the other, on the port that is given."""
    with closing(socket.create_server(("127.0.0.1", 0))) as server:

        def serve() -> None:
            while True:
                try:
                    peer, _ = server.accept()
                except OSError:
                    return
                with peer, peer.makefile("rb") as lines:
                    for line in lines:
                        peer.sendall(answers.get(line.strip(), b"?\n"))
                        if answers.get(b"hang up"):
                            break

        thread = threading.Thread(target=serve, name="instrument")
        thread.start()
        yield server.getsockname()[1]
        server.shutdown(socket.SHUT_RDWR)
    thread.join()


@pytest.fixture
def in_example(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    """The example's modules and entry points in this process."""
    points = {"machines": {"ball": "levbench_ball.machine:BALL"}, "devices": {"scpi": "levbench_ball.thermometer:SCPI"}}
    install(tmp_path / "site", "levbench-ball", {f"levbench.{kind}": named for kind, named in points.items()}, {})
    monkeypatch.setattr(sys, "path", [str(EXAMPLE), str(tmp_path / "site"), *sys.path])
    yield
    for name in [name for name in sys.modules if name.startswith("levbench_ball")]:
        del sys.modules[name]


@pytest.mark.usefixtures("in_example")
def test_its_device_is_read_as_registers_are() -> None:
    from bench.rigfile import load_rig
    from drivers.modbus import open_lines
    from drivers.registerdevice import RegisterDevice

    rig = load_rig(str(EXAMPLE / "rigs" / "ball.toml"))
    answers = {b"MEAS:TEMP? (@1)": b"296.25\n"}
    with instrument(answers) as port:
        links = {
            **rig.links,
            "instrument": rig.links["instrument"].model_copy(update={"url": f"scpi:127.0.0.1:{port}"}),
        }
        with open_lines(rig.model_copy(update={"links": links})) as lines:
            device = RegisterDevice("thermal", rig.devices["thermal"], lines["instrument"].port(1))
            assert device.check() == {"ambient": 296.25}
            assert lines["instrument"].stats.received == 1
            answers[b"MEAS:TEMP? (@1)"] = b"no sensor\n"
            with pytest.raises(RegisterRefused, match="answers 'no sensor'"):
                device.read()
            answers |= {b"MEAS:TEMP? (@1)": b"296.25", b"hang up": b"1"}
            with pytest.raises(LinkError, match="it hung up"):
                device.read()
            del answers[b"hang up"]
            answers[b"MEAS:TEMP? (@1)"] = b"297\n"
            assert device.read() == {"ambient": 297.0}
            assert lines["instrument"].stats.reconnects == 1
    with (
        pytest.raises(ConfigError, match=r"link instrument: scpi:127\.0\.0\.1:28532: nobody answers there"),
        open_lines(rig),
    ):
        pass


@pytest.mark.usefixtures("in_example")
@given(
    answer=st.binary(max_size=60) | st.floats().map(lambda x: repr(x).encode()) | st.integers().map(lambda n: b"%d" % n)
)
def test_no_answer_of_an_instrument_raises_what_nobody_expects(answer: bytes) -> None:
    from levbench_ball.thermometer import ScpiPort

    class Line:
        stats = LinkStats()

        def ask(self, question: str) -> str:
            return answer.decode("ascii", "replace").strip()

    try:
        words = ScpiPort(Line()).read("holding", 2, 2)  # type: ignore[arg-type]
    except RegisterRefused:
        return
    assert all(0 <= word <= 0xFFFF for word in words)
    assert len(words) == 2
