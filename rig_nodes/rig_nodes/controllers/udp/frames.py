# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The frames of the UDP lockstep protocol (docs/how_to/udp.md), and the controller's side of it; standard library only.

plug.py uses it, and it is copied unchanged to where a controller runs: ``serve(controller)`` answers until it is stopped.
include/rig_udp.h is the same for C.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import struct
import sys
import time
import types
from typing import Any

MAGIC, VERSION, PORT = 0x31474952, 3, 9002  # "RIG1"
HELLO, INFO, ASK, NAME, READY, SAMPLE, ANSWER, BYE, OWN = range(1, 10)
SETTINGS, OUTPUTS, TRANSDUCERS, GEARS = range(4)  # the rig's lists; a NAME contains the list of its name
WANT, SIGNAL, SETTING = range(1, 4)  # kinds of name in an OWN
HEADER = struct.Struct("<IHHIIII")  # magic, version, kind, session, frame, size of the whole frame, 0
BODIES = {
    HELLO: struct.Struct("<II16s"),  # levels, 0, id of the record that the controller was made for (empty: any)
    INFO: struct.Struct("<II4Idd16s"),  # level, 0, length of each of the rig's lists, period, command_high, record
    ASK: struct.Struct("<II"),  # index, list; from the rig: index in the controller's own names, 0
    # index, list, value (of a setting) or number (of a gear), name, unit (of a transducer)
    NAME: struct.Struct("<IId48s16s"),
    READY: struct.Struct("<II"),  # number of the controller's own names, 0
    SAMPLE: struct.Struct("<Qd2I"),  # sample, time, gear request, 0
    ANSWER: struct.Struct("<4I128s"),  # status, gear, shifting, flags, message
    BYE: struct.Struct("<128s"),  # message
    OWN: struct.Struct("<IId48s16s"),  # index, WANT, SIGNAL or SETTING, a setting's first value, name, unit
}
# kinds with numbers (f64) behind the body: currents, transducers, wanted, settings; or commands, setpoints, signals
LONGER = (SAMPLE, ANSWER)
MOST = 224  # numbers behind a body
TEXTS = {HELLO: (17,), INFO: (17,), NAME: (48, 16), OWN: (48, 16)}  # bytes of the text fields; in other kinds 128
LEVELS = {"duty": 1, "current": 2}
LONGEST = 2048  # bytes of any frame
AGAIN = 0.2  # s between two HELLO frames of a controller that waits for a rig
REFUSED = 1.0  # s until the next HELLO of a controller that the rig has sent away
PRIORITY = 10  # of real time, as of the rig's own nodes: with less, the controller waits for them on a busy machine
KEEP_ALIVE = 0.5  # s without a frame of the rig after which the controller sends HELLO again


class NoFrame(ValueError):
    """The bytes are no frame of this protocol and version."""


class OtherVersion(NoFrame):
    """The frame is of another version of the protocol."""


def pack(kind: int, session: int, frame: int, *values: float | str, more: tuple[float, ...] | list[float] = ()) -> bytes:
    """Return the bytes of a frame.

    Parameters
    ----------
    kind : int
        One of HELLO to OWN.
    session : int
        Number of the session.
    frame : int
        Number of the frame.
    *values : float or str
        Fields of the body; texts are encoded and cut to the length of their field.
    more : tuple or list of float
        Numbers behind the body.

    Returns
    -------
    bytes
        Header, body and numbers.
    """
    body, sizes = BODIES[kind], iter(TEXTS.get(kind, (128,)))
    data = [value.encode()[: next(sizes) - 1] if isinstance(value, str) else value for value in values]
    size = HEADER.size + body.size + 8 * len(more)
    return HEADER.pack(MAGIC, VERSION, kind, session, frame, size, 0) + body.pack(*data) + struct.pack("<%dd" % len(more), *more)


def unpack(data: bytes) -> tuple[int, int, int, tuple]:
    """Return the parts of a frame.

    Parameters
    ----------
    data : bytes
        The bytes that came.

    Returns
    -------
    tuple
        (kind, session, frame, values); values are the body's fields, then the numbers behind the body.

    Raises
    ------
    NoFrame
        When the bytes are no frame of this protocol and version.
    """
    if len(data) < HEADER.size:
        raise NoFrame(f"{len(data)} bytes are less than a header")
    magic, version, kind, session, frame, size, _ = HEADER.unpack_from(data)
    if magic != MAGIC:
        raise NoFrame("it does not begin with RIG1")
    if version != VERSION:
        raise OtherVersion(
            f"it uses version {version} of the protocol, this side uses {VERSION}: both need the "
            "rig_udp.py or rig_udp.h of the same rig"
        )
    if kind not in BODIES:
        raise NoFrame(f"there is no kind {kind}")
    end = HEADER.size + BODIES[kind].size
    more = (size - end) // 8 if kind in LONGER and end <= size <= end + 8 * MOST else 0
    if not len(data) == size == end + 8 * more:
        raise NoFrame(
            f"kind {kind} has {len(data)} bytes and says {size}, expected {end}"
            + ", or 8 more for each further number" * (kind in LONGER)
        )
    values = BODIES[kind].unpack_from(data, HEADER.size) + struct.unpack_from("<%dd" % more, data, end)
    return kind, session, frame, values


def text(field: bytes) -> str:
    """Return a text field without the zeros that fill it."""
    return field.split(b"\0", 1)[0].decode("utf-8", "replace")


class Client:
    """The controller's side of the protocol.

    Parameters
    ----------
    controller : Any
        An object with initialize / step / terminate like the rig's Python classes. Its ``wants``, ``signals`` and
        ``settings`` are used when it has them.
    host : str
        Name or address of the rig's machine.
    port : int
        The rig's UDP port.
    levels : tuple of str
        Levels at which the controller works: "duty", "current" or both.
    """

    def __init__(self, controller: Any, host: str = "127.0.0.1", port: int = PORT, levels: tuple[str, ...] = ("duty",)) -> None:
        self.controller, self.levels = controller, sum(LEVELS[name] for name in levels)
        self.rig = (host, port)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(self.rig)
        self.session, self.running, self.last, self.answer = 0, False, 0, b""
        self.hello_at = 0.0  # time.monotonic() from which on a controller that waits says HELLO
        self.outputs, self.transducers = [], []  # the rig's names
        self.last_message = ""  # the rig's newest message; the rig repeats it every second, it is printed once
        self.ignored = 0  # number of frames that were not used
        self.wants = tuple(getattr(controller, "wants", ()))
        signals = getattr(controller, "signals", ())
        self.signals = dict(signals) if isinstance(signals, dict) else dict.fromkeys(signals, "-")
        settings = dict(getattr(controller, "settings", {}))
        self.settings = tuple(settings)
        self.own = [(WANT, 0.0, name, "") for name in self.wants]
        self.own += [(SIGNAL, 0.0, name, unit) for name, unit in self.signals.items()]
        self.own += [(SETTING, float(value), name, "") for name, value in settings.items()]

    def send(self, kind: int, *values: float | str, frame: int = 0) -> None:
        """Send one frame; it is no error when the rig is not there yet, or cannot be reached for a while."""
        self.send_bytes(pack(kind, self.session, frame, *values))

    def send_bytes(self, data: bytes) -> None:
        """Send the bytes of a frame, as :meth:`send`."""
        with contextlib.suppress(OSError):
            self.socket.send(data)

    def receive(self, seconds: float) -> tuple[int, int, int, tuple] | None:
        """Return the rig's next frame.

        Parameters
        ----------
        seconds : float
            Longest wait [s].

        Returns
        -------
        tuple or None
            As :func:`unpack`; None when no frame comes in time, also when there is no rig.
        """
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            if not select.select([self.socket], [], [], left)[0]:
                return None
            try:
                return unpack(self.socket.recv(LONGEST))
            except OSError:  # there is no rig, or no way to it
                time.sleep(min(0.1, max(0.0, until - time.monotonic())))
            except NoFrame as error:
                self.ignore(str(error))
        return None

    def ignore(self, why: str) -> None:
        """Count a frame that is not used; the first, tenth, hundredth and so on is printed."""
        self.ignored += 1
        if str(self.ignored).strip("0") == "1":
            print(f"frame {self.ignored} that is ignored: {why}", file=sys.stderr)

    def serve(self, once: bool = False) -> None:
        """Answer until interrupted, or with ``once`` until the end of the first run; the rig receives the reason of the end."""
        why = "the controller was stopped"
        try:
            while not (self.run() and once):
                pass
        except Exception as error:
            why = f"{type(error).__name__}: {error}"
            raise
        finally:
            if self.running:
                self.send(BYE, why)
                self.end()
            self.socket.close()

    def run(self) -> bool:
        """Handle the next frame, if one comes; return True at the end of a run."""
        if not self.running and time.monotonic() >= self.hello_at:
            self.send(HELLO, self.levels, 0, "")
        came = self.receive(KEEP_ALIVE if self.running and self.last else AGAIN)
        if came is None:
            if self.running and not self.last:  # READY may have been lost; only the first sample shows that it arrived
                self.send(READY, len(self.own), 0)
            elif self.running:  # checks that the same rig is still there
                self.send(HELLO, self.levels, 0, "")
            return False
        kind, session, frame, values = came
        if kind == INFO and session != self.session:
            if values[0] in LEVELS.values():
                self.begin(session, values)
            else:
                self.ignore(f"the run is at level {values[0]}, which is neither duty (1) nor current (2)")
        elif kind == BYE and session == 0 and not self.running:
            self.show(text(values[0]))
            self.hello_at = time.monotonic() + REFUSED
        elif session != self.session or not self.running:
            return False
        elif kind == ASK and values[0] < len(self.own):
            self.send(OWN, values[0], *self.own[values[0]])
        elif kind == SAMPLE:
            expected = sum(map(len, (self.outputs, self.transducers, self.wants, self.settings)))
            if len(values) == 4 + expected:
                self.step(frame, values)
            else:
                self.ignore(f"a sample has {len(values) - 4} numbers, expected {expected}")
        elif kind == BYE:
            if not self.last:
                self.show(text(values[0]))
            self.end()
            return True
        return False

    def show(self, words: str) -> None:
        """Print a message of the rig once."""
        if words != self.last_message:
            self.last_message = words
            print(f"message of the rig: {words}", file=sys.stderr)

    def begin(self, session: int, info: tuple) -> None:
        """Fetch the rig's names, initialise the controller and report that it is ready; ``info`` has the fields of INFO."""
        level, _, *counts, period, command_high, record = info
        if self.running:
            self.end()
        self.session = session
        lists: list[list[tuple[float, str, str]]] = []
        for what, count in zip((SETTINGS, OUTPUTS, TRANSDUCERS, GEARS), counts, strict=True):
            lists.append([one for index in range(count) if (one := self.name(index, what)) is not None])
            if len(lists[-1]) < count:
                self.session = 0
                return
        self.outputs, self.transducers = ([name for _, name, _ in lists[what]] for what in (OUTPUTS, TRANSDUCERS))
        try:
            self.controller.initialize(
                types.SimpleNamespace(
                    period=period,
                    level={number: name for name, number in LEVELS.items()}[level],
                    command_high=command_high,
                    parameters={name: value for value, name, _ in lists[SETTINGS]},
                    outputs=tuple(self.outputs),
                    transducers={name: unit for _, name, unit in lists[TRANSDUCERS]},
                    gears={int(number): name for number, name, _ in lists[GEARS] if number.is_integer()},
                    record=text(record),
                )
            )
        except Exception as error:
            self.send(BYE, f"initialize failed: {type(error).__name__}: {error}")
            raise
        self.running, self.last, self.answer, self.last_message = True, 0, b"", ""
        self.send(READY, len(self.own), 0)

    def name(self, index: int, what: int) -> tuple[float, str, str] | None:
        """Return one of the rig's names; the request is repeated when the answer is lost.

        Parameters
        ----------
        index : int
            Place in the list.
        what : int
            The list: SETTINGS, OUTPUTS, TRANSDUCERS or GEARS.

        Returns
        -------
        tuple or None
            (value, name, unit); None when no answer comes, or the answer that the rig has another session.
        """
        for _ in range(50):
            self.send(ASK, index, what)
            came = self.receive(0.02)
            while came is not None:
                kind, session, _, values = came
                if kind == NAME and session == self.session and values[:2] == (index, what):
                    return values[2], text(values[3]), text(values[4])
                if kind == BYE and session == self.session:
                    return None
                came = self.receive(0.02)
        return None

    def step(self, frame: int, values: tuple) -> None:
        """Answer a sample: compute once, and send the same answer again when the same sample comes again."""
        if frame == self.last:
            self.send_bytes(self.answer)
            return
        if frame < self.last:
            return
        sample, at, gear_request, _, *rest = values
        current, measured, others, settings = (
            [rest.pop(0) for _ in names] for names in (self.outputs, self.transducers, self.wants, self.settings)
        )
        out = self.controller.step(
            types.SimpleNamespace(
                sample=sample,
                time=at,
                current=tuple(current),
                measured=tuple(measured),
                gear_request=gear_request,
                others=dict(zip(self.wants, others)),
                settings=dict(zip(self.settings, settings)),
                **dict(zip(self.transducers, measured)),
            )
        )
        nothing = (0.0,) * len(self.outputs)
        command, setpoint = (nothing if given is None else given for given in (out.command, out.setpoint))
        own = getattr(out, "signals", None) or {}
        self.last = frame
        self.answer = pack(
            ANSWER,
            self.session,
            frame,
            int(getattr(out, "status", 0)),
            int(out.gear),
            int(bool(out.shifting)),
            int(out.flags),
            str(getattr(out, "message", "")),
            more=[*map(float, command), *map(float, setpoint), *(float(own[name]) for name in self.signals if name in own)],
        )
        self.send_bytes(self.answer)

    def end(self) -> None:
        """End the run for the controller."""
        self.running, self.session = False, 0
        self.controller.terminate()


def rig_address(words: list[str]) -> tuple[str, int]:
    """Return (host, port) from a program's arguments; missing ones are those of a rig on this machine.

    A wrong host or port ends the program with one sentence and exit code 2.
    """
    host, port = (list(words) + ["127.0.0.1", str(PORT)][len(words) :])[:2]
    why = ""
    if not (port.isdecimal() and 0 < int(port) < 65536):
        why = f"'{port}' is no port; expected 1 to 65535, e.g. {PORT}"
    else:
        try:
            socket.getaddrinfo(host, None, socket.AF_INET)
        except (OSError, UnicodeError):
            why = f"there is no machine '{host}'; expected a name or an address such as 127.0.0.1"
    if why:
        print(f"{sys.argv[0]}: {why}", file=sys.stderr)
        sys.exit(2)
    return host, int(port)


def serve(
    controller: Any, host: str = "127.0.0.1", port: int = PORT, levels: tuple[str, ...] = ("duty",), once: bool = False
) -> None:
    """Connect a controller with a rig that is started with ``--controller udp:PORT``; either may start first.

    The calling thread gets real-time priority, as the rig's nodes have it, where the user may have it.

    Parameters
    ----------
    controller, host, port, levels
        As in :class:`Client`.
    once : bool
        True: return after the first run.
    """
    client = Client(controller, host, port, levels)
    with contextlib.suppress(AttributeError, OSError):  # of another system, or without the right
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    print(f"waiting for the rig at {host}:{port}, until Ctrl-C", flush=True)
    client.serve(once)
