"""The page's server: a thread for each client of a few, which is all that a client can hold. The standard library's server is
kept from what it does by itself: no look-up of names, no line on standard error, no traceback."""

from __future__ import annotations

import errno
import ipaddress
import logging
import socket
import socketserver
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any

from bench.errors import ConfigError
from bench.live.exchange import Exchange
from bench.live.handler import Handler
from bench.live.site import Served

logger = logging.getLogger("bench.live")
CLIENTS = 48  # at once
DRAIN_S = 0.3  # at the end, for what was said last


class LiveServer(socketserver.ThreadingMixIn, socketserver.TCPServer):
    """Listens from the start; serves within `serving`.

    Raises:
        ConfigError: the port is in use, or there is no such address on this host.
    """

    daemon_threads = True
    block_on_close = False
    allow_reuse_address = True
    request_queue_size = 32

    def __init__(
        self,
        site: Served,
        address: str,
        port: int,
        handler: Callable[..., Exchange] = Handler,
        options: str = "--live-",
    ) -> None:
        """`handler` is that of the site's requests; address and port were asked for by `options`bind and `options`port."""
        self.site = site
        self._open: set[socket.socket] = set()
        self._places = threading.BoundedSemaphore(CLIENTS)
        family, where = _resolved(address, port, options)
        self.address_family = family
        try:
            super().__init__(where, partial(handler, site))
        except OSError as error:
            raise ConfigError(_why(error, address, port, options)) from error

    @property
    def port(self) -> int:
        return int(self.server_address[1])

    @property
    def local(self) -> bool:
        """Whether it listens to this computer alone."""
        return ipaddress.ip_address(str(self.server_address[0])).is_loopback

    def process_request(self, request: Any, client_address: Any) -> None:
        """A thread for the client; with too many of them it is turned away without one."""
        if not self._places.acquire(blocking=False):
            self.shutdown_request(request)
            return
        self._open.add(request)
        try:
            super().process_request(request, client_address)
        except BaseException:
            self._open.discard(request)
            self._places.release()
            raise

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._open.discard(request)
            self._places.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that went away or spoke nonsense is no error of the run."""
        logger.debug("a client's request ended early", exc_info=True)

    @contextmanager
    def serving(self) -> Iterator[LiveServer]:
        """Serve within the block, in threads of its own."""
        thread = threading.Thread(target=self.serve_forever, args=(0.1,), name="live-server", daemon=True)
        thread.start()
        try:
            yield self
        finally:
            self.site.close()
            self._drained()
            self.shutdown()
            self.server_close()
            thread.join()
            for request in list(self._open):  # whoever is in the middle of something
                with suppress(OSError):
                    request.shutdown(socket.SHUT_RDWR)

    def _drained(self) -> None:
        """Let pages have what they have not had yet; one that takes nothing is not waited for."""
        until = time.monotonic() + DRAIN_S
        while self.site.followed and time.monotonic() < until:
            time.sleep(0.01)


def _resolved(address: str, port: int, options: str) -> tuple[socket.AddressFamily, Any]:
    try:
        found = socket.getaddrinfo(address, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
    except (OSError, UnicodeError) as error:
        raise ConfigError(f"{options}bind {address}: found no such address ({error}); expected one of this host, such as "
                          "127.0.0.1 or 0.0.0.0") from error  # fmt: skip
    return found[0], found[4]


def _why(error: OSError, address: str, port: int, options: str) -> str:
    if error.errno == errno.EADDRINUSE:
        return (f"{options}port {port}: found it in use on {address}; expected a free port; nothing was started. Next: end "
                f"what uses it, give another, or leave {options}port out for any free one")  # fmt: skip
    if error.errno == errno.EADDRNOTAVAIL:
        return (f"{options}bind {address}: found no such address on this host; expected one of its own, such as 127.0.0.1 or "
                "0.0.0.0; nothing was started")  # fmt: skip
    return f"{options}bind {address}: cannot listen on port {port}: {error.strerror or error}; nothing was started"
