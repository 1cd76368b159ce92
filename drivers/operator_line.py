"""The operator at the other end of a line: requests over TCP, one line each, answered by one line."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager

from bench.errors import ConfigError, LinkError, OperatorSilent
from bench.rigfile import linkurl

CONNECT_S, ANSWER_S = 3.0, 10.0
LONGEST = 4096  # bytes of an answer


class OperatorLine:
    """An open line."""

    def __init__(self, connection: socket.socket, where: str) -> None:
        self._connection, self._where = connection, where
        self._lost = ""  # why, once it is

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
        except (OSError, UnicodeError) as error:  # a host name that cannot be one is a UnicodeError
            why = getattr(error, "strerror", None) or error
            raise ConfigError(
                f"link operator: {url}: {why}. Next: start what answers there, or give --operator console"
            ) from error
        with connection:
            connection.settimeout(ANSWER_S)
            yield cls(connection, url)

    def request(self, line: str) -> str:
        """Ask, and wait for the answer. A line that was lost once stays so: a late answer must not be taken for that to
        the next question.

        Raises:
            OperatorSilent: no answer in time.
            LinkError: the line is lost, or says something unasked.
        """
        if self._lost:
            raise LinkError(f"link operator: {self._where}: {self._lost}")
        try:
            return self._ask(line)
        except OSError as error:
            self._lost = str(error.strerror or error)
            if isinstance(error, TimeoutError) and error.errno is None:  # ours, not that of a dead connection
                self._lost = f"no answer to {line!r} within {ANSWER_S:g} s"
                raise OperatorSilent(f"link operator: {self._where}: {self._lost}; the line is open") from error
        except LinkError as error:
            self._lost = str(error)
        raise LinkError(f"link operator: {self._where}: {self._lost}")

    def _ask(self, line: str) -> str:
        if unasked := self._unasked():
            raise LinkError(f"found {unasked[:60]!r} before anything was asked; expected one line for each question")
        text = " ".join(line.splitlines())
        self._connection.sendall(text.encode("utf-8", "replace") + b"\n")
        found = b""
        while not found.endswith(b"\n"):
            data = self._connection.recv(LONGEST)
            if not data:
                raise LinkError("its other end closed")
            found += data
            if len(found) > LONGEST:
                raise LinkError(f"found an answer of over {LONGEST} bytes")
            if b"\n" in found[:-1]:
                raise LinkError(f"found {found[:60]!r}; expected one line for each question")
        return found.decode("utf-8", "replace").strip()

    def _unasked(self) -> bytes:
        """What has come while nothing was asked; nothing, as a rule."""
        self._connection.settimeout(0.0)
        try:
            data = self._connection.recv(LONGEST)
        except BlockingIOError:
            return b""
        finally:
            self._connection.settimeout(ANSWER_S)
        if not data:
            raise LinkError("its other end closed")
        return data
