"""The C controller with a command line by what the page of its protocol says, line by line, without the bench."""

from __future__ import annotations

import random
import re
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import line_programs
import numpy as np
import pytest
from line_host import Host, summed
from line_programs import NOISE_A, TICKS_S, Controller, controller, law

PAGE = (line_programs.ROOT / "docs/reference/line-protocol.md").read_text(encoding="utf-8")
DIALOGUES = [b for b in re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL) if b.startswith("> ")]


@pytest.fixture
def there(line_program: Path) -> Iterator[Controller]:
    with controller(line_program, "tcp") as started:
        yield started


@pytest.fixture
def host(there: Controller) -> Iterator[Host]:
    made = Host(there.where)
    made.quiet()
    yield made
    made.close()


def ticks(line: str) -> int:
    return int(line.split()[1])


@pytest.mark.parametrize("dialogue", DIALOGUES)
def test_dialogues_of_the_page(host: Host, dialogue: str) -> None:
    said = [line[2:] for line in dialogue.splitlines() if line[0] == ">"]
    expected = [line[2:] for line in dialogue.splitlines() if line[0] == "<"]
    host.say(*said)
    host.until(lambda: len([x for x in host.lines if x[0] != "!"]) >= len(expected))
    assert [x for x in host.lines if x[0] != "!"] == expected


def test_its_start_on_a_terminal(line_program: Path) -> None:
    with controller(line_program, "pty") as there:
        host = Host(there.where)
        host.say("4 get kp.b")
        host.until(lambda: "4 ok kp.b=680000 N/m" in host.lines)
        host.listen(0.05)
        started = ["lira firmware 1.0", "! 0 boot power", "lira> 4 get kp.b"]  # lost where the port was opened later
        assert host.lines in ([*started, "4 ok kp.b=680000 N/m"], ["4 get kp.b", "4 ok kp.b=680000 N/m"])
        before = len(host.lines)
        assert host.heard == b"lira> "
        host.say("5 get kp.x\x7fb\x08b*00")
        host.until(lambda: len(host.lines) == before + 2)
        assert host.lines[-1] == "- err 6 checksum"
        host.close()


def test_a_line_again_is_answered_and_not_done_again(host: Host) -> None:
    assert host.asked("7 on current") == "7 ok CURRENT"
    assert host.asked("hb 1") == "- ok 1"
    assert host.asked("7 on current") == "7 ok CURRENT"
    assert host.asked("8 on current") == "8 err 4 state state=CURRENT"
    assert host.asked("8 on current") == "8 err 4 state state=CURRENT"
    assert [x for x in host.lines if x[0] == "!"] == [next(x for x in host.lines if x.endswith(" state CURRENT"))]
    host.say("9 list par", "9 list par")
    host.until(lambda: host.lines[-1] == "9 ok 42" and host.lines.count("9 ok 42") == 2)
    rows = [x for x in host.lines if x.startswith("9 + ")]
    assert len(rows) == 84
    assert rows[:42] == rows[42:]


def test_checksums(host: Host) -> None:
    assert host.asked(summed("7 get kp.b")) == summed("7 ok kp.b=680000 N/m")
    assert host.asked(summed("get kp.b")) == summed("- ok kp.b=680000 N/m")
    assert host.asked("8 set kp.b 1*11") == "- err 6 checksum"
    assert host.asked("8 get kp.b") == "8 ok kp.b=680000 N/m"
    assert host.asked("9 checksum on") == summed("9 ok on")
    assert host.asked("10 on current") == summed("10 ok CURRENT")
    host.until(lambda: any("fault" in x for x in host.lines))
    assert all(x == summed(x[:-3]) for x in host.lines[-3:])


def test_what_is_too_long_or_nothing(host: Host) -> None:
    assert host.asked("5 get " + 91 * "x") == "- err 7 too long"
    assert host.asked("5 get " + 90 * "x") == "5 err 2 arguments unknown parameter"
    host.say("", "   ")
    assert host.asked("6 stat").startswith("6 ok tick=")
    assert len(host.lines) == 3


def test_a_host_that_says_nothing(there: Controller, host: Host) -> None:
    assert host.asked("1 on current") == "1 ok CURRENT"
    host.until(lambda: any(" state FAULT" in x for x in host.lines))
    events = {x.split(" ", 2)[2]: ticks(x) for x in host.lines if x[0] == "!"}
    on, fault, state = (events[x] for x in ("state CURRENT", "fault HEARTBEAT_LOST", "state FAULT"))
    assert 0.08 <= (fault - on) / TICKS_S < 0.081
    assert state == fault
    assert there.said() == f"heartbeat {on} lost {fault} CURRENT"
    assert host.asked("2 on current") == "2 err 4 state state=FAULT"
    assert host.asked("3 clear") == "3 ok IDLE"


def test_a_counter_that_stands_still_is_no_heartbeat(host: Host) -> None:
    host.say("on current", "hb 7")
    for _ in range(4):
        host.listen(0.03)
        host.say("hb 7")
    host.until(lambda: any(" fault HEARTBEAT_LOST" in x for x in host.lines))


def test_telemetry(host: Host) -> None:
    host.say("1 stream 500", "2 on current", "3 step q_L 2")
    for count in range(10):
        host.say(f"hb {count}")
        host.listen(0.02)
    host.say("4 stop")
    host.listen(0.02)
    assert host.asked("5 stream 0") == "5 ok 0"
    assert {n for n, _, data in host.blocks} == {0xFFFF}
    assert {len(data) for _, _, data in host.blocks} == {44}
    rows = np.array([struct.unpack("<H6h10hHBBHhH", data) for _, _, data in host.blocks])
    assert set(np.diff([at for _, at, _ in host.blocks])) == {560}
    assert set(np.diff(rows[:, 0])) == {1}
    current = rows[rows[:, 18] == 2]
    assert np.mean(current[1:, 16]) == pytest.approx(2000, abs=4)
    assert np.mean(current[1:, 15]) == pytest.approx(0, abs=4)
    assert set(current[:, 17] // 100) <= {399, 400}
    assert max(current[:, 22]) < 80
    assert rows[-1, 22] == 65535
    assert rows[-1, 18] == 1


def captured(host: Host, arm: str, *then: str) -> tuple[dict[str, int], bytes]:
    """What `cap stat` says at the end, and the bytes."""
    number = host.asked(f"100 cap arm {arm}").split()[2]
    host.say(*then)
    host.until(lambda: any(x.endswith(f"capture {number} done") for x in host.lines))
    words = host.asked("101 cap stat").split()
    assert words[2:4] == [number, "done"]
    stat = {k: int(v) for k, _, v in (word.partition("=") for word in words[4:])}
    host.blocks.clear()
    host.say(f"102 cap read 0 {stat['bytes']}", "hb 77")
    host.until(lambda: any(x.startswith("102 ok") for x in host.lines))
    data = b"".join(piece for _, _, piece in host.blocks)
    assert [at for _, at, _ in host.blocks] == list(range(0, len(data), 1024))
    assert host.lines[-1] == f"102 ok cap sent={len(host.blocks)}"
    assert len(data) == stat["bytes"]
    assert zlib.crc32(data) == stat["crc"]
    return stat, data


def test_a_capture_about_a_step(host: Host) -> None:
    host.say("on current", "hb 1")
    mask = 1 << 53 | 1 << 45
    stat, data = captured(host, f"{mask:x} 280000 4000 100 step", "hb 2", "step q_R1 -4")
    assert (stat["samples"], stat["every"], stat["channels"]) == (4000, 1, 2)
    rows = np.frombuffer(data, "<i2").reshape(-1, 2)
    assert np.mean(rows[:, 0]) * 0.122 == pytest.approx(400, abs=0.05)
    n = np.arange(4000)
    left = rows[:, 1] * 4e-4 + 4 * law((n - stat["trigger"] + 1) / TICKS_S)
    assert np.std(left) == pytest.approx(NOISE_A, rel=0.05)


def test_a_step_that_ends_by_itself(host: Host) -> None:
    """5 ms of the program's own ticks, whatever its host does meanwhile."""
    host.say("on current", "hb 1")
    stat, data = captured(host, f"{1 << 53:x} 280000 4000 100 step", "hb 2", "step q_R1 -4 0.005")
    n = np.arange(4000) - stat["trigger"] + 1
    begun, over = (np.where(n > at, law(np.maximum(n - at, 0) / TICKS_S), 0.0) for at in (0, 1400))
    left = np.frombuffer(data, "<i2") * 4e-4 + 4 * (begun - over)
    assert np.std(left) == pytest.approx(NOISE_A, rel=0.05)
    assert host.asked("90 step q_R1 1 1.5").startswith("90 err 3")


def test_a_part_of_a_capture(host: Host) -> None:
    _, data = captured(host, "3ffffffffffff 35000 200 10 now")
    host.blocks.clear()
    assert host.asked("103 cap read 19900 5000") == "103 ok cap sent=1"
    assert host.blocks == [(1, 19900, data[19900:])]
    assert host.asked("104 cap read 20000 10") == "104 ok cap sent=0"
    assert host.asked("105 cap cancel") == "105 ok"
    assert host.asked("106 cap stat") == "106 err 10 no capture"


def test_noise_is_survived(host: Host) -> None:
    """Bytes at random, then the first words of a host: it answers as before."""
    draw = random.Random(3)
    for _ in range(30):
        host.say(bytes(draw.choice([*range(0x20, 0x7F), 8, 10, 13, 0]) for _ in range(300)).decode())
        host.listen(0.002)
    host.quiet()
    assert host.asked("5 get ki.b") == "5 ok ki.b=10200000 N/(m s)"


def test_the_dialect_knows_no_other_words(line_program: Path) -> None:
    with controller(line_program, "tcp", "north") as there:
        host = Host(there.where)
        host.quiet()
        for verb in ("get", "set", "on", "lift", "land", "stop", "hb", "id", "cap"):
            assert host.asked(f"1 {verb} x") == f"1 err 21 unknown verb {verb}"
        assert host.asked("2 rd kp.b") == "2 ok kp.b=680000 N/m"
        assert host.asked("3 scope?") == "3 err 30 no capture"
        host.close()
