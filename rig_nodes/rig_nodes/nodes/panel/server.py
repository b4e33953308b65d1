# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The server of the operator's page, on tornado: the page's files, the figures of shifts, and one websocket for each browser.

The verb `panel` runs it. Every request passes nodes.panel.access first.
"""

from __future__ import annotations

import asyncio
import logging
import signal
import socket
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError, RequestHandler, StaticFileHandler, stream_request_body
from tornado.websocket import WebSocketHandler

from ...base import RigError
from .access import LOOPBACK, Access
from .bench import Bench
from .files import controller_text, controller_values, recording
from .orders import AT_ONCE, TOO_MANY, answered, obey
from .page import SLOW, Page
from .panel import FRAMES, Panel

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from .own_rig import OwnRig

STATIC = Path(__file__).with_name("static")
LARGEST = 256 * 1024  # bytes of a message from a page
LARGEST_FILE = 64_000_000  # bytes of a measured file
NAMED = 80  # letters of its name that are kept, the last ones with its ending
UNREAD = 64 * 1024  # bytes that the system keeps for a browser that does not read
PIECE = 256 * 1024  # bytes of a file that are sent at once
DRAWN = "+"  # what a page says when it has a frame
HEADERS = {
    # nothing but this server's own files is loaded or run, and no other page may frame this one
    "Content-Security-Policy": "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Server": "rig",
}


class Guarded(RequestHandler):
    """A handler that answers only who has access."""

    panel: Panel

    def initialize(self, access: Access, panel: Panel, **more: Any) -> None:
        """Take what all handlers of a server have in common."""
        self.access, self.panel = access, panel
        super().initialize(**more)  # type: ignore[misc]

    def set_default_headers(self) -> None:
        """Set HEADERS on every answer."""
        for name, value in HEADERS.items():
            self.set_header(name, value)

    def prepare(self) -> None:
        """Refuse with 403 who has no access."""
        why = self.access.refusal(self.request)
        if why:
            raise HTTPError(403, reason=None, log_message=why.replace("%", "%%"))

    def write_error(self, status_code: int, **kwargs: Any) -> None:
        """Answer an error with a sentence."""
        error = kwargs.get("exc_info", (None, None))[1]
        why = self.access.refusal(self.request) if status_code == 403 else getattr(error, "why", self._reason)
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"rig: {why}\n")


class Home(Guarded):
    """The page itself; it leaves the token with the browser as a cookie that no script can read."""

    def get(self) -> None:
        """Send the page."""
        self.set_cookie(self.access.cookie, self.access.token, httponly=True, samesite="Strict", path="/")
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.write((STATIC / "index.html").read_bytes())


class Files(Guarded, StaticFileHandler):
    """Scripts and styles of the page."""

    def set_extra_headers(self, path: str) -> None:
        """Have the browser ask anew after an update of the package."""
        self.set_header("Cache-Control", "no-cache")


class Figure(Guarded):
    """The figure of a shift."""

    async def get(self, key: str, name: str) -> None:
        """Send one of its pictures."""
        with refusals():
            picture = await self.panel.shifts.picture(int(key), name)
        self.set_header("Content-Type", "image/svg+xml")
        self.write(picture)


class Controller(Guarded):
    """The controller's settings as a file."""

    def get(self) -> None:
        """Send them as the rig has them now."""
        with refusals():
            text = controller_text(self.panel)
        self.set_header("Content-Type", "text/yaml; charset=utf-8")
        self.write(text)

    async def post(self) -> None:
        """Set what a file says, all or nothing."""
        with refusals():
            values = controller_values(self.panel, self.request.body.decode("utf-8", "replace"))
            if values:
                await answered(self.panel.bench.set(values), "answer of the controller")
        self.write(f"{len(values)} values set" if values else "the rig has these values already")


@stream_request_body
class Measured(Guarded):
    """A measured file, whose signals are laid over the shifts."""

    def prepare(self) -> None:
        """Take its parts into a folder of its own; it may be larger than what else a page sends."""
        super().prepare()
        self.request.connection.set_max_body_size(LARGEST_FILE)  # type: ignore[union-attr]
        self._folder = tempfile.TemporaryDirectory(prefix="rig-panel-")
        name = "".join(c if c.isascii() and (c.isalnum() or c in "-_.") else "_" for c in self.get_query_argument("name", ""))
        self._file = Path(self._folder.name, name.lstrip(".")[-NAMED:] or "measured.csv").open("wb")

    def data_received(self, chunk: bytes) -> None:
        """Take a part."""
        self._file.write(chunk)

    async def post(self) -> None:
        """Send what was found in it."""
        self._file.close()
        with refusals():
            if self.panel.about is None:
                raise RigError("no rig answers yet")
            self.write(await self.panel.shifts.measured(Path(self._file.name), self.panel.about.record))

    def on_finish(self) -> None:
        """Remove the file."""
        if hasattr(self, "_file"):
            self._file.close()
            self._folder.cleanup()


class Recording(Guarded):
    """What has been recorded up to now: the bag, or its report."""

    async def get(self, what: str) -> None:
        """Send it in pieces, so that a long recording takes no memory."""
        with refusals():
            async with recording(self.panel, self.get_query_argument("name", "recording"), what == "report.html") as path:
                with path.open("rb") as file:
                    while piece := file.read(PIECE):
                        self.write(piece)
                        await self.flush()


class Refused(HTTPError):
    """A request that is refused with a sentence, which the body has: a reason phrase may not hold every letter."""

    def __init__(self, why: str) -> None:
        super().__init__(409)
        self.why = why


@contextmanager
def refusals() -> Iterator[None]:
    """Answer a RigError of the block as a refused request, with its sentence."""
    try:
        yield
    except RigError as error:
        raise Refused(str(error)) from None


class Nothing(Guarded):
    """Any other address."""

    def get(self) -> None:
        """There is nothing."""
        raise HTTPError(404)


class Socket(Guarded, WebSocketHandler):
    """One browser."""

    page: Page | None = None
    told: ClassVar[dict[str, str]] = {}  # reasons why pages were dropped, by the name that a page gave itself

    def check_origin(self, origin: str) -> bool:
        """Return whether an Origin has access, which `prepare` has looked at already."""
        return not self.access.refusal(self.request)

    def open(self, *_args: str, **_kwargs: str) -> None:
        """Greet the page."""
        assert self.ws_connection is not None
        stream = self.ws_connection.stream  # type: ignore[attr-defined]
        stream.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, UNREAD)
        self.page, self.asked = Page(self), set[asyncio.Task]()
        if why := self.told.pop(self._name, None):
            self.page.tell({"kind": "note", "text": f"{why}; it is connected again"})
        self.panel.greet(self.page)

    @property
    def _name(self) -> str:
        return self.get_query_argument("page", "")[:40]

    def on_message(self, message: str | bytes) -> None:
        """Do what the page asks for."""
        assert self.page is not None
        if message == DRAWN:
            self.page.drawn()
            return
        if len(self.asked) >= 2 * AT_ONCE:
            self.page.tell({"kind": "answer", "id": None, "ok": False, "text": TOO_MANY})
            return
        task = asyncio.get_running_loop().create_task(obey(self.panel, self.page, message, len(self.asked)))
        self.asked.add(task)
        task.add_done_callback(self.asked.discard)

    def on_close(self) -> None:
        """Forget the page; what it has ordered goes on."""
        if self.page is not None:
            if self.page.dropped and len(self.told) < 100:
                self.told[self._name] = SLOW[1]
            self.panel.pages.discard(self.page)
            self.panel.wish()


def listening(address: str, port: int) -> list[socket.socket]:
    """Return the open sockets of an address; RigError when the port is taken or the address is not this machine's."""
    try:
        return bind_sockets(port, address)
    except OSError as error:
        raise RigError(f"port {port} of {address} cannot be opened ({error.strerror}); give another one with --port") from None


class PanelServer:
    """The page of one rig, from the first request to the signal that ends it.

    Parameters
    ----------
    domain : int
        ROS domain of the rig.
    own : OwnRig or None
        The rig, when the page has started it.
    sockets : list of socket
        From :func:`listening`.
    """

    def __init__(self, domain: int, own: OwnRig | None, sockets: list[socket.socket]) -> None:
        address, port = sockets[0].getsockname()[:2]
        self.access = Access(address or LOOPBACK, port)
        self._domain, self._own, self._sockets = domain, own, sockets

    def run(self, greet: Callable[[str], None]) -> None:
        """Serve until SIGINT or SIGTERM; ``greet`` gets the address with the token, once."""
        asyncio.run(self._serve(greet))

    async def _serve(self, greet: Callable[[str], None]) -> None:
        logging.getLogger("tornado.general").setLevel(logging.ERROR)  # a refused request is no news for the terminal
        over, loop = asyncio.Event(), asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, over.set)
        bench = Bench(self._domain)
        panel = Panel(bench, self._domain, self._own)
        with_all = {"access": self.access, "panel": panel}
        application = Application(
            [
                (r"/", Home, with_all),
                (r"/live", Socket, with_all),
                (r"/static/(.*)", Files, with_all | {"path": str(STATIC)}),
                (r"/controller\.yaml", Controller, with_all),
                (r"/measured", Measured, with_all),
                (r"/(bag\.zip|report\.html)", Recording, with_all),
                (r"/shift/(\d{1,9})/([a-z_]+\.svg)", Figure, with_all),
            ],
            default_handler_class=Nothing,
            default_handler_args=with_all,
            websocket_max_message_size=LARGEST,
            log_function=lambda handler: None,
        )
        server = HTTPServer(application, max_body_size=LARGEST, max_header_size=16 * 1024, idle_connection_timeout=60.0)
        server.add_sockets(self._sockets)
        try:
            greet(self.access.url)
            await self._tick(panel, over)
        finally:
            server.stop()
            await panel.close()
            bench.close()

    async def _tick(self, panel: Panel, over: asyncio.Event) -> None:
        """Move the panel on, at most FRAMES times a second."""
        while not over.is_set():
            panel.tick()
            try:
                await asyncio.wait_for(over.wait(), 1.0 / FRAMES)
            except TimeoutError:
                pass
