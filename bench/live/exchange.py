"""What every request of a client goes through, in its own thread: who may ask, how long it may take, how it is answered."""

from __future__ import annotations

import io
import json
import socket
from collections.abc import Callable, Mapping
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from typing import Any

from bench.live import gate
from bench.live.gate import PAGE_POLICY, REPORT_POLICY, SECURE, Refused
from bench.live.reading import Bounded
from bench.live.site import Served

HEAD_S = 5.0  # for a whole request
SEND_S = 10.0  # a client that takes nothing for so long is given up
SENT_BYTES = 131072  # that the system holds for a client: what it reads later is so old at most


class Exchange(BaseHTTPRequestHandler):
    """Answers once and closes. What is asked for is of those that derive from it."""

    protocol_version = "HTTP/1.1"
    server_version = "levbench"

    def __init__(self, site: Served, *of_the_server: Any) -> None:
        self.served = site  # answered is within the next line
        super().__init__(*of_the_server)

    def setup(self) -> None:
        super().setup()
        self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SENT_BYTES)
        self.rfile = io.BufferedReader(Bounded(self.connection, HEAD_S))

    def handle(self) -> None:
        self.close_connection = True
        self.handle_one_request()

    def version_string(self) -> str:
        return self.server_version

    def log_message(self, format: str, *args: Any) -> None:
        """Standard error belongs to the run."""

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """What the standard library refuses by itself, said as everything else; another method is not allowed."""
        self.close_connection = True
        status = HTTPStatus.METHOD_NOT_ALLOWED if code == HTTPStatus.NOT_IMPLEMENTED else HTTPStatus(code)
        with suppress(OSError):
            self._refuse(status, status.phrase)

    def _lacking(self, path: str, others: tuple[str, ...]) -> None:
        raise Refused(405, "method: not this one here") if path in others else Refused(404, "no such page")

    def _guarded(self, serve: Callable[[], None]) -> None:
        """Refusals of all kinds; a client that is gone or too slow ends here."""
        try:
            try:
                local, port, *_ = self.connection.getsockname()
                host = gate.check_host(self.headers, local, port, self.served.named)
                gate.check_origin(self.headers, host)
                serve()
            except Refused as refused:
                self._refuse(refused.status, refused.text)
        except OSError:  # also a timeout: nobody is there
            pass

    def _asset(self, path: str) -> None:
        asset = self.served.assets[path]
        self._send(200, asset.content_type, asset.content, PAGE_POLICY)

    def _known(self) -> None:
        """By cookie or token.

        Raises:
            Refused: 403, by neither.
        """
        if not gate.same(gate.cookie_of(self.headers, self._cookie_name()), self.served.cookie):
            gate.check_token(self.headers, self.served.token)

    def _cookie(self, path: str) -> str:
        """For what a frame, an image or a link asks for below a path: they send no header of ours."""
        return f"{self._cookie_name()}={self.served.cookie}; HttpOnly; SameSite=Strict; Path={path}"

    def _cookie_name(self) -> str:
        return f"levbench-{self.connection.getsockname()[1]}"

    def _document(self, kind: str, content: bytes) -> None:
        """A report or a figure: without scripts, its styles with it."""
        self._send(200, kind, content, REPORT_POLICY)

    def _write(self, content: bytes) -> None:
        if content:
            self.connection.settimeout(SEND_S)
            self.wfile.write(content)

    def _refuse(self, status: int, text: str) -> None:
        self._send(status, "text/plain; charset=utf-8", f"{text}\n".encode(), PAGE_POLICY)

    def _json(self, status: int, content: Mapping[str, Any], more: Mapping[str, str] | None = None) -> None:
        self._send(status, "application/json", json.dumps(content).encode(), PAGE_POLICY, more)

    def _send(
        self, status: int, content_type: str, content: bytes, policy: str, more: Mapping[str, str] | None = None
    ) -> None:
        self.connection.settimeout(SEND_S)
        self._head(status, content_type, len(content), policy, more or {})
        self.end_headers()
        self._write(content)

    def _head(self, status: int, content_type: str, length: int | None, policy: str, more: Mapping[str, str]) -> None:
        self.request_version = self.protocol_version  # whatever was asked in: an answer has a head
        self.send_response(status)
        size = {} if length is None else {"Content-Length": str(length)}
        fields = {
            "Content-Type": content_type,
            **size,
            **SECURE,
            "Content-Security-Policy": policy,
            "Connection": "close",
        }
        for name, value in {**fields, **more}.items():
            self.send_header(name, value)
