"""Endpoints: TCP ports and ptys on which clients appear and disappear."""

from __future__ import annotations

import errno
import selectors
import socket
from collections.abc import Callable
from typing import Protocol

from bench.errors import ConfigError
from sim_backend.serving.connection import Connection
from sim_backend.serving.peers import Peer
from sim_backend.serving.ptys import Pty

CLIENTS = 16  # of one TCP port


class Port(Protocol):
    """An endpoint. `line` is what a user puts into a rig file or `--link`: `controller slcan:/dev/pts/5`."""

    link: str
    line: str
    connections: list[Connection]

    def plug(self, plugged: bool) -> None:
        """Make the endpoint vanish with its clients, or come back."""
        ...

    def wake(self) -> None:
        """The selector says that something happened at the port itself."""
        ...

    def look(self) -> None:
        """Every now and then: what no selector tells."""
        ...

    def end(self, connection: Connection) -> None:
        """A client is gone."""
        ...

    def close(self) -> None:
        """Release everything."""
        ...


class TcpPort:
    """A listening socket.

    Args:
        line: with `{}` where HOST:PORT goes.
        address: host and port; port 0 takes any.
        peer: makes what speaks to a new client.
        selector: gets the listening socket with this port as its data, each client with (port, connection).

    Raises:
        ConfigError: the port is in use, or the address is none of this host's.
    """

    def __init__(
        self, line: str, address: tuple[str, int], peer: Callable[[], Peer], selector: selectors.BaseSelector
    ) -> None:
        self.link = line.split()[0]
        self._socket = listening(self.link, address)
        self._address: tuple[str, int] = self._socket.getsockname()[:2]
        host, port = self._address
        self.line = line.format(f"[{host}]:{port}" if ":" in host else f"{host}:{port}")
        self.connections: list[Connection] = []
        self._peer, self._selector = peer, selector
        self._listen()

    def _listen(self) -> None:
        self._selector.register(self._socket, selectors.EVENT_READ, (self, None))

    def plug(self, plugged: bool) -> None:
        self.close()
        if plugged:
            self._socket = listening(self.link, self._address)
            self._listen()

    def wake(self) -> None:
        try:
            client, _ = self._socket.accept()
        except OSError:  # it went away again
            return
        try:
            stream = TcpStream(client)
        except OSError:
            client.close()
            return
        if len(self.connections) >= CLIENTS:
            stream.close()
            return
        connection = Connection(stream, self._peer())
        self.connections.append(connection)
        self._selector.register(client, selectors.EVENT_READ, (self, connection))

    def look(self) -> None:
        """A selector tells everything about sockets."""

    def end(self, connection: Connection) -> None:
        stream = connection.stream
        self._selector.unregister(stream.fileno())
        self.connections.remove(connection)
        if isinstance(stream, TcpStream):
            stream.close()

    def close(self) -> None:
        for connection in list(self.connections):
            self.end(connection)
        if self._socket.fileno() >= 0:
            self._selector.unregister(self._socket)
            self._socket.close()


class TcpStream:
    """A connected socket as a `Stream`."""

    def __init__(self, client: socket.socket) -> None:
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._client = client

    def fileno(self) -> int:
        return self._client.fileno()

    def read(self, count: int) -> bytes | None:
        try:
            return self._client.recv(count)
        except BlockingIOError:
            return None

    def write(self, data: bytes) -> int:
        return self._client.send(data)

    def close(self) -> None:
        self._client.close()


def listening(name: str, address: tuple[str, int]) -> socket.socket:
    """A nonblocking listening socket.

    Raises:
        ConfigError: the port is in use, or the address is none of this host's.
    """
    host, port = address
    where = f"link {name}: port {port} of {host}"
    server = None
    try:
        family, _, _, _, resolved = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        server = socket.socket(family, socket.SOCK_STREAM)
        if hasattr(socket, "SO_REUSEADDR") and not hasattr(socket, "SO_EXCLUSIVEADDRUSE"):
            server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # a port left in TIME_WAIT is free
        server.bind(resolved)
        server.listen()
        server.setblocking(False)
    except OSError as error:
        if server is not None:
            server.close()
        if error.errno == errno.EADDRINUSE:
            raise ConfigError(
                f"{where}: found it in use, perhaps by another `bench serve`; end that program, or give another port: "
                f"--link {name}=URL with port 0 takes any free one"
            ) from error
        raise ConfigError(f"{where}: {error.strerror or error}; expected an address of this host") from error
    return server


class PtyPort:
    """A serial port: one client at a time, and the bytes of nobody's output are lost, as on a cable that hangs free."""

    def __init__(self, line: str, peer: Callable[[], Peer], selector: selectors.BaseSelector) -> None:
        self.link, self._form = line.split()[0], line
        self._pty: Pty | None = Pty()
        self.line = line.format(self._pty.path)
        self.connections: list[Connection] = []
        self._peer, self._selector = peer, selector

    def plug(self, plugged: bool) -> None:
        """When it comes back it may have another path; `line` tells."""
        self.close()
        if plugged:
            self._pty = Pty()
            self.line = self._form.format(self._pty.path)

    def wake(self) -> None:
        """A pty listens to nothing."""

    def look(self) -> None:
        """See whether somebody opened it; no event tells."""
        if self._pty is not None and not self.connections and self._pty.in_use:
            connection = Connection(self._pty, self._peer())
            self.connections.append(connection)
            self._selector.register(self._pty.fileno(), selectors.EVENT_READ, (self, connection))

    def end(self, connection: Connection) -> None:
        self._selector.unregister(connection.stream.fileno())
        self.connections.remove(connection)
        if self._pty is not None:
            self._pty.forget()

    def close(self) -> None:
        pty, self._pty = self._pty, None
        for connection in list(self.connections):
            self.end(connection)
        if pty is not None:
            pty.close()
