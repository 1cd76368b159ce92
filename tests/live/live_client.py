"""A page as the tests have it: requests over real sockets, and a thread that follows the events."""

from __future__ import annotations

import http.client
import json
import socket
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

WAIT_S = 20.0  # for what must come; only a failure waits so long


@dataclass(frozen=True)
class Reply:
    status: int
    headers: Mapping[str, str]
    body: bytes

    @property
    def json(self) -> Any:
        return json.loads(self.body)


class Client:
    """Of the address that was printed."""

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        assert parts.hostname is not None
        assert parts.port is not None
        self.host, self.port, self.token = parts.hostname, parts.port, parts.fragment
        self.here = f"{self.host}:{self.port}"

    def ask(self, method: str, path: str, headers: Mapping[str, str] | None = None, body: bytes | None = None) -> Reply:
        """One request with these headers alone, and a Host where none is given."""
        connection = http.client.HTTPConnection(self.host, self.port, timeout=WAIT_S)
        given = {"Host": self.here, **(headers or {})}
        try:
            connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
            for name, value in given.items():
                connection.putheader(name, value)
            if body is not None and "Content-Length" not in given and "Transfer-Encoding" not in given:
                connection.putheader("Content-Length", str(len(body)))
            connection.endheaders(body)
            answer = connection.getresponse()
            return Reply(answer.status, dict(answer.getheaders()), answer.read())
        finally:
            connection.close()

    def post(self, path: str, content: Any, **headers: str) -> Reply:
        """As the page does it."""
        own = {"X-Levbench-Token": self.token, "Content-Type": "application/json", "Origin": f"http://{self.here}"}
        return self.ask("POST", path, own | headers, json.dumps(content).encode())

    def raw(self, sent: bytes) -> bytes:
        """Any bytes, and all that comes back until the server closes."""
        with socket.create_connection((self.host, self.port), timeout=WAIT_S) as connection:
            parts = []
            with suppress(ConnectionError):  # it was closed before all was read
                connection.sendall(sent)
                connection.shutdown(socket.SHUT_WR)
                while part := connection.recv(65536):
                    parts.append(part)
            return b"".join(parts)


class Page:
    """Follows the events until the server closes; use as a context manager. `on` is called with each event in its thread."""

    def __init__(self, client: Client, on: Callable[[str, Any], None] = lambda *_: None) -> None:
        self.client, self._on = client, on
        self.heard: list[tuple[str, Any]] = []
        self._news = threading.Condition()
        self._over = False
        self._connection = http.client.HTTPConnection(client.host, client.port, timeout=WAIT_S)
        self._connection.request("GET", "/events", headers={"X-Levbench-Token": client.token})
        self._socket = self._connection.sock
        self._answer = self._connection.getresponse()
        self.cookie = (self._answer.getheader("Set-Cookie") or "").partition(";")[0]
        self._thread = threading.Thread(target=self._follow, daemon=True)

    def __enter__(self) -> Page:
        if self._answer.status != 200:
            self._socket.close()
            self._answer.close()
        assert self._answer.status == 200
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):  # the server was faster
            self._socket.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._answer.close()
        self._connection.close()

    def _follow(self) -> None:
        kind = ""
        try:
            while line := self._answer.readline():
                text = line.decode().rstrip("\n")
                if text.startswith("event: "):
                    kind = text.removeprefix("event: ")
                elif text.startswith("data: "):
                    data = json.loads(text.removeprefix("data: "))
                    with self._news:
                        self.heard.append((kind, data))
                        self._news.notify_all()
                    self._on(kind, data)
        except OSError:
            pass
        with self._news:
            self._over = True
            self._news.notify_all()

    def wait(self, kind: str, wanted: Callable[[Any], bool] = lambda _: True) -> Any:
        """The first event of that kind that is wanted, also of those that came before."""
        with self._news:
            found = self._news.wait_for(lambda: self._first(kind, wanted) or self._over, WAIT_S)
            first = self._first(kind, wanted)
            assert first, f"no {kind}; heard {[k for k, _ in self.heard][-20:]}, {found=}"
            return first[0]

    def wait_for_the_end(self) -> list[tuple[str, Any]]:
        """All that was heard, once the server has closed."""
        with self._news:
            assert self._news.wait_for(lambda: self._over, WAIT_S)
            return list(self.heard)

    def kinds(self, *names: str) -> list[Any]:
        return [data for kind, data in list(self.heard) if kind in names]

    def _first(self, kind: str, wanted: Callable[[Any], bool]) -> list[Any]:
        return [data for k, data in self.heard if k == kind and wanted(data)][:1]
