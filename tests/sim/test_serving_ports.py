"""Endpoints of a served rig: TCP ports and ptys, busy, full, unplugged."""

from __future__ import annotations

import os
import selectors
import socket
from collections.abc import Iterator

import pytest
from serving_clients import LOOPBACK, PATIENCE_S, T0, adapter, address_of

from bench.errors import ConfigError
from sim_backend.serving import ptys
from sim_backend.serving.connection import Connection
from sim_backend.serving.peers import PacketPeer
from sim_backend.serving.ports import CLIENTS, Port, PtyPort, TcpPort

needs_ptys = pytest.mark.skipif(not ptys.AVAILABLE, reason="no ptys here")


def tcp(selector: selectors.BaseSelector, opened: list[Port], address: tuple[str, int] = LOOPBACK) -> TcpPort:
    port = TcpPort("controller slcan:socket://{}", address, adapter, selector)
    opened.append(port)
    return port


def test_port_zero_takes_any_free_one_and_a_busy_one_is_refused_with_a_remedy(
    selector: selectors.BaseSelector, opened: list[Port]
) -> None:
    port = tcp(selector, opened)
    host, number = address_of(port)
    assert port.line == f"controller slcan:socket://127.0.0.1:{number}"
    assert port.link == "controller"
    with pytest.raises(ConfigError, match=rf"link controller: port {number} of {host}: found it in use.*port 0"):
        tcp(selector, opened, (host, number))


@pytest.mark.parametrize("host", ["203.0.113.7", "no such host"])
def test_an_address_of_another_host_is_refused(selector: selectors.BaseSelector, opened: list[Port], host: str) -> None:
    with pytest.raises(ConfigError, match="expected an address of this host"):
        tcp(selector, opened, (host, 0))


def woken(selector: selectors.BaseSelector) -> list[Connection]:
    """Clients that the selector names; the ports themselves accept."""
    found = []
    for key, _ in selector.select(PATIENCE_S):
        port, client = key.data
        if client is None:
            port.wake()
        else:
            found.append(client)
    return found


def test_so_many_clients_and_no_more(selector: selectors.BaseSelector, opened: list[Port]) -> None:
    port = tcp(selector, opened)
    clients = []
    try:
        for k in range(CLIENTS + 1):
            clients.append(socket.create_connection(address_of(port), PATIENCE_S))
            woken(selector)
            assert len(port.connections) == min(k + 1, CLIENTS)
        assert clients[-1].recv(1) == b""
    finally:
        for client in clients:
            client.close()


def test_a_tcp_endpoint_that_is_unplugged_ends_its_clients_and_comes_back_at_its_address(
    selector: selectors.BaseSelector, opened: list[Port]
) -> None:
    port = tcp(selector, opened)
    address = address_of(port)
    with socket.create_connection(address, PATIENCE_S) as client:
        woken(selector)
        port.plug(False)
        assert client.recv(1) == b""
        assert not port.connections
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(address, PATIENCE_S)
    port.plug(True)
    with socket.create_connection(address, PATIENCE_S):
        woken(selector)
        assert len(port.connections) == 1


@pytest.fixture
def terminals() -> Iterator[list[int]]:
    found: list[int] = []
    yield found
    for descriptor in found:
        os.close(descriptor)


def opened_terminal(path: str, terminals: list[int]) -> int:
    terminals.append(os.open(path, os.O_RDWR | os.O_NOCTTY))
    return terminals[-1]


@needs_ptys
def test_a_pty_serves_one_client_after_the_other_and_the_next_finds_nothing_of_the_last(
    selector: selectors.BaseSelector, opened: list[Port], terminals: list[int]
) -> None:
    port = PtyPort("controller slcan:{}", adapter, selector)
    opened.append(port)
    path = port.line.removeprefix("controller slcan:")
    port.look()
    assert not port.connections
    assert not selector.select(0)
    for _ in range(2):
        terminal = opened_terminal(path, terminals)
        port.look()
        port.look()
        (client,) = port.connections
        os.write(terminal, b"V\r")
        assert woken(selector) == [client]
        client.receive(T0)
        client.flush()
        assert os.read(terminal, 100) == b"VSIM1\r"  # raw: CR stays CR
        client.peer.take(b"N\r", T0)
        client.flush()  # and this it will not read
        os.close(terminals.pop())
        assert woken(selector) == [client]
        client.receive(T0)
        assert client.closed
        port.end(client)
        assert not selector.select(0)
    assert not port.connections


@needs_ptys
def test_a_pty_that_is_unplugged_is_an_error_to_its_client(
    selector: selectors.BaseSelector, opened: list[Port], terminals: list[int]
) -> None:
    port = PtyPort("controller serial:{}", PacketPeer, selector)
    opened.append(port)
    terminal = opened_terminal(port.line.removeprefix("controller serial:"), terminals)
    port.look()
    port.plug(False)
    with pytest.raises(OSError, match=r"\[Errno 5\]"):
        os.write(terminal, b"x")
    port.look()
    port.plug(True)
    again = opened_terminal(port.line.removeprefix("controller serial:"), terminals)
    port.look()
    assert len(port.connections) == 1
    os.write(again, b"x")
    assert len(woken(selector)) == 1
