"""One request of one client, in its own thread. Nothing is changed by GET; POST is for an answer and for STOP."""

from __future__ import annotations

import io
import json
import select
import socket
from collections.abc import Callable, Mapping
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from typing import Any

from bench.live import gate
from bench.live.gate import PAGE_POLICY, REPORT_POLICY, SECURE, Refused
from bench.live.reading import Bounded
from bench.live.site import Site
from bench.question import Answer

HEAD_S = 5.0  # for a whole request
SEND_S = 10.0  # a client that takes nothing for so long is given up
LIFE_S = 5.0  # from one sign of life to the next
LOOK_S = 0.5  # until it is seen that a client is gone
SENT_BYTES = 131072  # that the system holds for a client: what it reads later is so old at most
ANSWER_CHARACTERS, NAME_CHARACTERS = 500, 40
PAGE = "page"
OPEN, POSTED = ("/events", "/report.html"), ("/answer", "/stop")


class Handler(BaseHTTPRequestHandler):
    """Answers once and closes."""

    protocol_version = "HTTP/1.1"
    server_version = "levbench"

    def __init__(self, site: Site, *of_the_server: Any) -> None:
        self.site = site  # answered is within the next line
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

    def do_GET(self) -> None:
        path = self.path.partition("?")[0]
        assets = self.site.assets
        if path in assets:
            self._guarded(lambda: self._send(200, assets[path].content_type, assets[path].content, PAGE_POLICY))
        elif path == "/events":
            self._guarded(self._events)
        elif path == "/report.html":
            self._guarded(self._report)
        else:
            self._guarded(lambda: self._lacking(path, POSTED))

    def do_POST(self) -> None:
        path = self.path.partition("?")[0]
        if path in POSTED:
            self._guarded(self._answer if path == "/answer" else self._stop)
        else:
            self._guarded(lambda: self._lacking(path, (*OPEN, *self.site.assets)))

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
                host = gate.check_host(self.headers, local, port, self.site.named)
                gate.check_origin(self.headers, host)
                serve()
            except Refused as refused:
                self._refuse(refused.status, refused.text)
        except OSError:  # also a timeout: nobody is there
            pass

    def _events(self) -> None:
        gate.check_token(self.headers, self.site.token)
        if not self.site.places.acquire(blocking=False):
            raise Refused(503, "too many pages are open. Next: close one of them")
        try:
            self._head(200, "text/event-stream; charset=utf-8", None, PAGE_POLICY, {"Set-Cookie": self._cookie()})
            self.end_headers()
            with self.site.hub.reading() as reader:
                silent = 0.0
                while not self.site.hub.closed and not self._gone():
                    part = reader.more(LOOK_S)
                    silent = 0.0 if part else silent + LOOK_S
                    if silent >= LIFE_S:
                        part, silent = b": here\n\n", 0.0
                    self._write(part)
                self._write(reader.more(0.0))
        finally:
            self.site.places.release()

    def _cookie(self) -> str:
        """For the report alone: a frame or a link sends no header of ours."""
        name, value = self._cookie_name(), self.site.cookie
        return f"{name}={value}; HttpOnly; SameSite=Strict; Path=/report.html"

    def _cookie_name(self) -> str:
        return f"levbench-{self.connection.getsockname()[1]}"

    def _report(self) -> None:
        site = self.site
        if not gate.same(gate.cookie_of(self.headers, self._cookie_name()), site.cookie):
            gate.check_token(self.headers, site.token)
        path = site.report
        if path is None:
            raise Refused(404, "report: there is none; it comes when the run has ended")
        try:
            content = path.read_bytes()
        except OSError as error:
            raise Refused(404, f"report: cannot be read: {error.strerror}") from error
        self._send(200, "text/html; charset=utf-8", content, REPORT_POLICY)
        site.fetched += 1

    def _answer(self) -> None:
        body = self._body()
        number, text = body.get("id"), body.get("answer")
        if type(number) is not int or not isinstance(text, str) or len(text) > ANSWER_CHARACTERS:
            raise Refused(
                400, f"body: expected id, a number, and answer, a text of at most {ANSWER_CHARACTERS} characters"
            )
        own = Answer(_line(text), self._by(body))
        first = self.site.questions.answer(number, own)
        if first is None:
            return self._json(409, {"accepted": False, "by": ""})
        return self._json(200 if first is own else 409, {"accepted": first is own, "by": first.by})

    def _stop(self) -> None:
        body = self._body()
        stop, hub = self.site.stop, self.site.hub
        if stop is None or hub.ended:
            raise Refused(409, "stop: there is nothing to stop here")
        stop(self._by(body))
        self._json(202, {"accepted": True})

    def _by(self, body: Mapping[str, Any]) -> str:
        """Who asks: at the page, and the name that they gave there."""
        name = body.get("by", "")
        if not isinstance(name, str):
            raise Refused(400, "body: expected by, a name")
        name = _line(name)[:NAME_CHARACTERS].strip()
        return f"{PAGE}: {name}" if name else PAGE

    def _body(self) -> dict[str, Any]:
        """The body, JSON, from somebody who has the token.

        Raises:
            Refused: it is something else.
        """
        gate.check_token(self.headers, self.site.token)
        content = self.rfile.read(gate.body_length(self.headers))
        try:
            body = json.loads(content)
        except (ValueError, RecursionError) as error:
            raise Refused(400, "body: expected JSON") from error
        if not isinstance(body, dict):
            raise Refused(400, "body: expected a JSON object")
        return body

    def _gone(self) -> bool:
        """Whether the client closed its end; what it says beside its request is not read."""
        if not select.select([self.connection], [], [], 0)[0]:
            return False
        self.connection.settimeout(SEND_S)
        return not self.connection.recv(4096)

    def _write(self, content: bytes) -> None:
        if content:
            self.connection.settimeout(SEND_S)
            self.wfile.write(content)

    def _refuse(self, status: int, text: str) -> None:
        self._send(status, "text/plain; charset=utf-8", f"{text}\n".encode(), PAGE_POLICY)

    def _json(self, status: int, content: Mapping[str, Any]) -> None:
        self._send(status, "application/json", json.dumps(content).encode(), PAGE_POLICY)

    def _send(self, status: int, content_type: str, content: bytes, policy: str) -> None:
        self.connection.settimeout(SEND_S)
        self._head(status, content_type, len(content), policy, {})
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


def _line(text: str) -> str:
    """One line of what can be shown."""
    return "".join(c if c.isprintable() else " " for c in text)
