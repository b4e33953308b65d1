# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One browser's connection: texts that must arrive, and frames of which only the newest counts.

nodes.panel.server opens it. A browser that does not read for STUCK seconds is dropped, so that nothing piles up here.
"""

from __future__ import annotations

import json
import time
from collections import deque
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from asyncio import Future
    from collections.abc import Mapping

    from tornado.websocket import WebSocketHandler

    from .tracks import Tracks, Wish

STUCK = 10.0  # s without progress after which a browser is dropped
WAITING = 500  # texts that wait for a browser
SLOW = 4001, "this page did not keep up and was dropped"


class Page:
    """What is sent to one browser.

    Attributes
    ----------
    wish : Wish or None
        What its charts show.
    dropped : bool
        True when it is given up.
    """

    def __init__(self, socket: WebSocketHandler) -> None:
        self._socket, self._texts = socket, deque[str]()
        self._sent = None  # the future of what is on its way
        self._since = 0.0  # time.monotonic() when that was sent
        self._drawing = 0.0  # time.monotonic() when the frame was sent that the browser has not drawn yet; 0 for none
        self.wish: Wish | None = None
        self.dropped = False

    def tell(self, message: Mapping[str, Any]) -> None:
        """Send a message as JSON, after those before it."""
        self._texts.append(json.dumps(message))  # all of it ASCII: a lone surrogate in a name could not be sent
        if len(self._texts) > WAITING:
            self._drop()
        self.send_texts()

    def send_texts(self) -> None:
        """Send the next texts, as far as the browser takes them."""
        while self._texts and not self.dropped and not self._busy():
            self._send(self._texts.popleft(), binary=False)

    def send_frame(self, tracks: Tracks) -> None:
        """Send what is new of the charts, unless the browser has not taken what was sent before."""
        if self.wish is None or self.dropped or self._texts or self._busy():
            return
        if self._drawing:
            if time.monotonic() - self._drawing > STUCK:
                self._drop()
            return
        frame = self.wish.frame(tracks)
        if frame is not None:
            self._send(frame, binary=True)
            self._drawing = time.monotonic()

    def drawn(self) -> None:
        """Take the browser's word that it has the last frame, so that the next one may come."""
        self._drawing = 0.0

    def _busy(self) -> bool:
        if self._sent is None or self._sent.done():
            return False
        if time.monotonic() - self._since > STUCK:
            self._drop()
        return True

    def _send(self, data: str | bytes, binary: bool) -> None:
        from tornado.websocket import WebSocketClosedError

        try:
            self._sent, self._since = self._socket.write_message(data, binary), time.monotonic()
            self._sent.add_done_callback(self._on_sent)
        except WebSocketClosedError:
            self.dropped = True

    def _on_sent(self, done: Future) -> None:
        done.exception()  # a browser that is gone is no error
        self.send_texts()

    def _drop(self) -> None:
        """Give the browser up; the code tells it why, if it ever reads again."""
        if not self.dropped:
            self.dropped = True
            self._socket.close(*SLOW)
            stream = self._socket.ws_connection and self._socket.ws_connection.stream
            if stream:
                stream.close()
