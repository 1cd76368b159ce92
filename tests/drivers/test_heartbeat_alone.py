"""What becomes of the heartbeats when the bench is killed, stopped or interrupted."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from heartbeat_ports import metronome, socket_port

from drivers import heartbeat

PARENT = """
import os, select, signal, sys
from drivers.heartbeat import Beat, HeartbeatProcess, WriterSpec
port, lease_s, fork = int(sys.argv[1]), float(sys.argv[2]), sys.argv[3] == "fork"
signal.signal(signal.SIGINT, lambda *_: os.write(1, b"interrupted\\n"))
heart = HeartbeatProcess(Beat(0x010, bytes(8), range(32, 48), True, 0.01, lease_s), WriterSpec("slcan", port))
if fork and os.fork() == 0:  # a process that keeps the parent's end of the pipe open
    os.close(port)
    sys.stdin.read()
    os._exit(0)
os.write(1, b"%d\\n" % heart._process.pid)
while not select.select([0], [], [], 0.01)[0]:
    heart.renew_lease()
heart.close()
"""


@contextmanager
def parent(port: socket.socket, lease_s: float, fork: bool = False) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    """A bench of its own that renews the lease until its standard input ends; and the id of its heartbeat process."""
    process = subprocess.Popen(
        [sys.executable, "-c", PARENT, str(port.fileno()), str(lease_s), "fork" if fork else ""],
        cwd=heartbeat.ROOT, pass_fds=[port.fileno()], start_new_session=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    port.close()
    with process:
        assert process.stdout is not None
        yield process, int(process.stdout.readline())


def test_heartbeats_end_at_once_when_the_bench_is_killed() -> None:
    with socket_port() as (far, port), parent(port, lease_s=1000.0) as (bench, _):
        far.beats(3)
        bench.kill()
        far.end()
        assert bench.stderr is not None
        assert bench.stderr.read() == b""


def test_heartbeats_end_when_the_bench_is_killed_but_its_pipe_lives_on() -> None:
    with socket_port() as (far, port), parent(port, lease_s=1000.0, fork=True) as (bench, _):
        far.beats(3)
        bench.kill()
        far.end()


def test_heartbeats_end_with_the_lease_when_the_bench_is_stopped() -> None:
    with metronome() as passes, socket_port() as (far, port), parent(port, lease_s=0.1) as (bench, _):
        far.beats(3)
        bench.send_signal(signal.SIGSTOP)
        try:
            passes(60)  # 0.3 s
            far.waiting()
            passes(20)
            assert far.waiting() == []
        finally:
            bench.send_signal(signal.SIGCONT)
        far.beats(3)
        assert bench.stdin is not None
        bench.stdin.close()
        far.end()


def test_signals_that_stop_the_bench_do_not_stop_the_heartbeats() -> None:
    with socket_port() as (far, port), parent(port, lease_s=1000.0) as (bench, heart):
        far.beats(1)
        os.killpg(bench.pid, signal.SIGINT)
        assert bench.stdout is not None
        assert bench.stdout.readline() == b"interrupted\n"
        assert os.getpgid(heart) == os.getsid(heart) == heart
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            os.kill(heart, number)
        far.waiting()
        far.beats(20)
        assert bench.stdin is not None
        bench.stdin.close()
        far.end()
