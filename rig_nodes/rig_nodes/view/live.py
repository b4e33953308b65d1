# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The live view: it sends messages of a running rig to a Rerun server on loopback, to which viewers can connect at any time.

nodes.live_view receives the messages and uses this module. Nothing here waits for a viewer, and memory and time are bounded: a
full queue drops its oldest message, the server its oldest data, and the live view ends whether or not a viewer reads.
"""

from __future__ import annotations

import socket
import tempfile
import threading
import time
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..bags import cdr
from ..base import RigError
from ..rig import Signal, Topic
from . import layout
from .convert import import_rerun
from .curves import log_state_styles, log_style, times
from .document import event_row, markdown_table
from .message_blocks import Blocks
from .pages import Pages
from .recorded import derivative
from .viewer import child, surroundings

if TYPE_CHECKING:
    from types import ModuleType

    from rerun import RecordingStream

APPLICATION = "virtual_rig_live"  # differs from that of recorded runs, so that a viewer can show both, each with its layout
PORT = 9876  # the default of `rerun --connect`
MEMORY = "100MB"  # memory of the server for viewers that connect later, about four minutes
WINDOW = 10.0  # s, time span of the plots
WAITING = 20_000  # messages queued between callbacks and sender, about 5 s of the rig
PERIOD = 0.2  # s between two transmissions; short enough for a smoothly moving picture, long enough for large blocks
TELL = 1.0  # s between two updates of the counts in the text panel
BACK = 1.0  # s; a larger jump back of time means that another run has begun
SERVER_START = 15.0  # s
FLUSH = 1.0  # s for sending the data that the SDK still holds
CLOCK_TOPIC = "/rig/state"
EVENT = "rig_msgs/msg/Event"


def live_topics(pages: Pages) -> list[Topic]:
    """Return the topics that the live view of a rig shows: those of its signals, and the events."""
    known = pages.known
    shown = {signal.topic for signal in known.signals.values()}
    return [topic for topic in known.topics.values() if topic.name in shown or topic.ros_type == EVENT]


class Server:
    """A Rerun server as a child process; viewers connect to ``url``.

    The SDK can serve too, but on all interfaces of the machine; this server is bound to 127.0.0.1.
    """

    def __init__(self, port: int | None = None, memory: str = MEMORY) -> None:
        """Start the server.

        Parameters
        ----------
        port : int, optional
            Port to listen on; by default PORT, or a free port when PORT is taken.
        memory : str
            Memory for viewers that connect later.

        Raises
        ------
        RigError
            When the server does not start.
        """
        self.port = _free_port(PORT, 0) if port is None else _free_port(port)
        self.url = f"rerun+http://127.0.0.1:{self.port}/proxy"
        self._folder = tempfile.TemporaryDirectory(prefix="rig-live-")
        self._words = tempfile.TemporaryFile()
        environment = {**surroundings(Path(self._folder.name)), "TMPDIR": self._folder.name, "RUST_LOG": "warn"}
        where = ["--serve-grpc", "--bind", "127.0.0.1", "--port", str(self.port), "--server-memory-limit", memory]
        self.process = child(where, environment, self._words)
        try:
            self._wait()
        except BaseException:
            self.close()
            raise

    def _wait(self) -> None:
        deadline = time.monotonic() + SERVER_START
        while True:
            if self.process.poll() is not None:
                raise RigError(f"the server of the live view ended at once ({self.last_words()})")
            try:
                socket.create_connection(("127.0.0.1", self.port), 1.0).close()
                return
            except OSError:
                if time.monotonic() > deadline:
                    raise RigError(f"the server of the live view did not answer within {SERVER_START:g} s") from None
                time.sleep(0.02)

    def ended(self) -> bool:
        """Return True when the server has ended."""
        return self.process.poll() is not None

    def last_words(self) -> str:
        """Return the last line that the server printed."""
        self._words.seek(0)
        lines = self._words.read().decode(errors="replace").split("\n")
        return next((line.strip() for line in reversed(lines) if line.strip()), "without a word")

    def close(self) -> None:
        """End the server at once; the data that it holds for viewers is lost."""
        self.process.kill()
        self.process.wait()
        self._words.close()
        self._folder.cleanup()


def _free_port(*wanted: int) -> int:
    """Return the first of the ports that is free on loopback, where 0 stands for any; RigError when none is free."""
    for port in wanted:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", port))
                return probe.getsockname()[1]
            except OSError:
                continue
    raise RigError(f"--port {wanted[0]}: the port is in use on 127.0.0.1; give another, or leave --port away")


class Sender:
    """The bounded queue and the one thread that calls the SDK; ``put`` never waits.

    ``dropped`` counts messages for which the queue had no room, ``lost`` messages that never arrived (gaps in the numbers of the
    messages that no drop explains), and ``unreadable`` those that are not a message of their topic.
    """

    def __init__(self, url: str, title: str, pages: Pages, window: float = WINDOW) -> None:
        """Start the sender.

        Parameters
        ----------
        url : str
            Address of a running Server.
        title : str
            Name of the recording.
        pages : Pages
            The pages of the rig.
        window : float
            Time span of the plots [s].
        """
        self.rr = import_rerun()
        self.received = self.dropped = self.unreadable = self._gaps = self._in_hand = 0
        self.failure = ""
        self._url, self._title, self._pages, self._window = url, title, pages, window
        self._queue: deque = deque()
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._shown = {topic.name: _Shown(pages, topic) for topic in live_topics(pages)}
        self._newest = 0.0  # newest time of the rig's clock [s]
        self._recordings = 0
        self._reported_at = 0.0
        self._rec = None
        self._thread = threading.Thread(target=self._run, name="sender", daemon=True)
        self._thread.start()

    def put(self, topic: str, data: bytes) -> None:
        """Queue one encoded message; a full queue drops its oldest message."""
        with self._lock:
            self.received += 1
            if len(self._queue) >= WAITING:
                self._queue.popleft()
                self.dropped += 1
            self._queue.append((topic, data))

    @property
    def waiting(self) -> int:
        """Number of messages that are not sent yet."""
        return len(self._queue) + self._in_hand

    @property
    def lost(self) -> int:
        """Number of messages that never arrived here."""
        return max(0, self._gaps - self.dropped - self.unreadable)

    def close(self, seconds: float) -> bool:
        """Send the queued messages; return False when this takes longer than ``seconds`` and is abandoned."""
        self._closing.set()
        self._thread.join(seconds)
        return not self._thread.is_alive()

    def summary(self) -> str:
        """Return one sentence with the counts."""
        text = f"{self.received} messages, {self.dropped} dropped here, {self.lost} lost on the way"
        return text + (f", {self.unreadable} unreadable" if self.unreadable else "")

    # ---- methods of the sender's thread

    def _run(self) -> None:
        try:
            self._begin()
            closing = False
            while not closing:
                closing = self._closing.wait(PERIOD)
                with self._lock:
                    queue, self._queue = self._queue, deque()
                    self._in_hand = len(queue)
                self._send(queue)
                self._in_hand = 0
                self._tell()
            self._leave()
        except RuntimeError as error:  # raised by the SDK once its server has ended
            self.failure = " ".join(str(error).split())

    def _begin(self) -> None:
        """Begin a new recording, for the first run and whenever time begins again."""
        rr = self.rr
        if self._rec is not None:
            self._leave()
        self._recordings += 1
        self._newest = 0.0
        self._rec = rr.RecordingStream(APPLICATION, send_properties=False)
        self._rec.connect_grpc(self._url, default_blueprint=layout.live_blueprint(self._pages, self._window))
        number = f", run {self._recordings}" if self._recordings > 1 else ""
        self._rec.send_recording_name(self._title + number)
        for shown in self._shown.values():
            shown.begin(rr, self._rec)

    def _leave(self) -> None:
        """Send the data that the SDK still holds to the server, which keeps it."""
        self._rec.flush(timeout_sec=FLUSH)
        self._rec.disconnect()

    def _send(self, queue: deque) -> None:
        """Send all queued messages; begin a new recording where the rig's clock jumps back."""
        by_topic: dict[str, list[bytes]] = {}
        for topic, data in queue:
            if topic == CLOCK_TOPIC and len(data) >= 12:
                now = cdr.stamp(data) / 1e9
                if now < self._newest - BACK:
                    self._send_topics(by_topic)
                    by_topic = {}
                    self._begin()
                self._newest = max(self._newest, now)
            by_topic.setdefault(topic, []).append(data)
        self._send_topics(by_topic)

    def _send_topics(self, by_topic: dict[str, list[bytes]]) -> None:
        for topic, messages in by_topic.items():
            gaps, unreadable = self._shown[topic].send(self.rr, self._rec, messages, self._newest)
            self._gaps += gaps
            self.unreadable += unreadable

    def _tell(self) -> None:
        """Send the counts to the text panel."""
        if time.monotonic() - self._reported_at < TELL or not self._newest:
            return
        self._reported_at = time.monotonic()
        rows = [
            ("", ""),
            ("time of the rig", f"{self._newest:.1f} s"),
            ("messages", str(self.received)),
            ("dropped here", str(self.dropped)),
            ("lost on the way", str(self.lost)),
            ("unreadable", str(self.unreadable)),
        ]
        said = "The metrics of the shifts come with the report of the run."
        text = "\n\n".join([f"# {self._title}", said, markdown_table(rows)])
        document = self.rr.TextDocument.columns(text=[text], media_type=["text/markdown"])
        # rec.log would add the wall clock as a second time
        self._rec.send_columns("report", [times(self.rr, [self._newest])], document)


class _Shown:
    """The display of one topic: its messages in blocks to the columns of its signals, or its events."""

    def __init__(self, pages: Pages, topic: Topic) -> None:
        self.topic, self._pages = topic, pages
        self._signals = pages.known.on_topic(topic.name)
        self._rates = [(one, name) for one, name in pages.rates.values() if pages.known.signal(name).topic == topic.name]
        self._blocks = Blocks(topic)
        self._last: int | None = None  # sequence number of the newest message
        self._states: dict[str, int] = {}

    def begin(self, rr: ModuleType, rec: RecordingStream) -> None:
        """Log names and colours to a new recording."""
        self._last = None
        self._states.clear()
        for shown in (*self._signals, *(one for one, _ in self._rates)):
            (log_state_styles if shown.states else log_style)(rr, rec, self._pages, shown)

    def send(self, rr: ModuleType, rec: RecordingStream, messages: list[bytes], newest: float) -> tuple[int, int]:
        """Send one block; return how many messages are missing before or in it and how many are unreadable."""
        block = self._blocks.of(messages)
        if block is None:
            return 0, len(messages)
        # a user's command may have no stamp; it is placed at the time of its arrival
        t = np.where(block.times == 0.0, newest, block.times)
        try:
            for shown in self._signals:
                self._send_signal(rr, rec, shown, t, block.values(shown))
            for rate, name in self._rates:
                self._send_signal(rr, rec, rate, *derivative(t, block.values(self._pages.known.signal(name)).astype(float)))
            if self.topic.ros_type == EVENT:
                self._send_events(rr, rec, t, block.whole)
        except ValueError:
            return 0, len(messages)
        return self._missing(block.rows["seq"].astype(np.int64)), len(messages) - len(block.messages)

    def _send_signal(self, rr: ModuleType, rec: RecordingStream, signal: Signal, t: np.ndarray, values: np.ndarray) -> None:
        if not signal.states:
            if len(t):
                columns = rr.Scalars.columns(scalars=signal.shown(values.astype(float)))
                rec.send_columns(layout.entity(signal), [times(rr, t)], columns)
            return
        # each block begins with the present state, because the server drops old data, and with it a state that lasts long
        change = np.flatnonzero(np.diff(values.astype(int), prepend=-1) != 0)
        states = [signal.states.get(int(value), str(int(value))) for value in values[change]]
        rec.send_columns(layout.entity(signal), [times(rr, t[change])], rr.StateChange.columns(state=states))

    def _send_events(self, rr: ModuleType, rec: RecordingStream, t: np.ndarray, events: list) -> None:
        texts, levels = zip(*(event_row(at, self.topic.name, event.name, event.text) for at, event in zip(t, events)))
        rec.send_columns(f"events/{self.topic.name.split('/')[1]}", [times(rr, t)], rr.TextLog.columns(text=texts, level=levels))

    def _missing(self, numbers: np.ndarray) -> int:
        before = numbers[:1] - 1 if self._last is None else np.array([self._last])
        self._last = int(numbers[-1])
        steps = np.diff(np.concatenate([before, numbers]))
        return int((steps[steps > 1] - 1).sum())
