"""The operator at the other end of a line: requests over TCP, one line each, answered by one line."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager

from bench import linkurl
from bench.errors import ConfigError, LinkError

CONNECT_S, ANSWER_S = 3.0, 10.0
LONGEST = 4096


class OperatorLine:
    """An open line."""

    def __init__(self, connection: socket.socket, where: str) -> None:
        self._connection, self._where = connection, where
        self._rest = b""

    @classmethod
    @contextmanager
    def open(cls, url: str) -> Iterator[OperatorLine]:
        """Connect to `line:HOST:PORT` for the block.

        Raises:
            ConfigError: not such a URL, or nobody answers there.
        """
        parsed = linkurl.parse(url)
        if parsed.scheme != "line":
            raise ConfigError(f"link operator: found {url!r}; expected such as {linkurl.EXAMPLES['line']!r}")
        try:
            connection = socket.create_connection(parsed.address, CONNECT_S)
        except OSError as error:
            raise ConfigError(
                f"link operator: {url}: {error.strerror or error}. Next: start what answers there, or give --operator console"
            ) from error
        with connection:
            connection.settimeout(ANSWER_S)
            yield cls(connection, url)

    def request(self, line: str) -> str:
        """Ask, and wait for the answer.

        Raises:
            LinkError: the line is lost or stays silent.
        """
        try:
            self._connection.sendall(line.replace("\n", " ").encode() + b"\n")
            while b"\n" not in self._rest:
                data = self._connection.recv(LONGEST)
                if not data or len(self._rest) > LONGEST:
                    raise LinkError(f"link operator: {self._where}: the line is lost")
                self._rest += data
        except OSError as error:
            raise LinkError(f"link operator: {self._where}: {error.strerror or error}") from error
        answer, _, self._rest = self._rest.partition(b"\n")
        return answer.decode("utf-8", "replace").strip()
