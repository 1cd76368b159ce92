"""One request of one client, in its own thread. Nothing is changed by GET; POST is for an answer and for STOP."""

from __future__ import annotations

import json
import select
from collections.abc import Mapping
from typing import Any

from bench.live import gate
from bench.live.exchange import SEND_S, Exchange
from bench.live.gate import PAGE_POLICY, Refused
from bench.live.site import Site
from bench.question import Answer

LIFE_S = 5.0  # from one sign of life to the next
LOOK_S = 0.5  # until it is seen that a client is gone
ANSWER_CHARACTERS, NAME_CHARACTERS = 500, 40
PAGE = "page"
OPEN, POSTED = ("/events", "/report.html"), ("/answer", "/stop")


class Handler(Exchange):
    """Of a run that goes on."""

    def __init__(self, site: Site, *of_the_server: Any) -> None:
        self.site = site
        super().__init__(site, *of_the_server)

    def do_GET(self) -> None:
        path = self.path.partition("?")[0]
        if path in self.site.assets:
            self._guarded(lambda: self._asset(path))
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

    def _events(self) -> None:
        gate.check_token(self.headers, self.site.token)
        if not self.site.places.acquire(blocking=False):
            raise Refused(503, "too many pages are open. Next: close one of them")
        try:
            self._head(
                200, "text/event-stream; charset=utf-8", None, PAGE_POLICY, {"Set-Cookie": self._cookie("/report.html")}
            )
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

    def _report(self) -> None:
        site = self.site
        self._known()
        path = site.report
        if path is None:
            raise Refused(404, "report: there is none; it comes when the run has ended")
        try:
            content = path.read_bytes()
        except OSError as error:
            raise Refused(404, f"report: cannot be read: {error.strerror}") from error
        self._document("text/html; charset=utf-8", content)
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


def _line(text: str) -> str:
    """One line of what can be shown."""
    return "".join(c if c.isprintable() else " " for c in text)
