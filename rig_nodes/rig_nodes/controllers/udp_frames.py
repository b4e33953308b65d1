# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The frames of the UDP lockstep protocol (docs/udp.md), and the controller's side of it; standard library only.

Used by udp.py, and copied as it is to where a controller runs: ``serve(controller)`` answers until it is stopped.
include/rig_udp.h is the same for C.
"""

import select
import socket
import struct
import sys
import time
import types

MAGIC, VERSION, PORT = 0x31474952, 2, 9002  # "RIG1"
HELLO, INFO, ASK, PARAMETER, READY, SAMPLE, ANSWER, BYE, OWN = range(1, 10)
WANT, SIGNAL, SETTING = range(1, 4)  # what the name in an OWN is
HEADER = struct.Struct("<IHHIIII")  # magic, version, kind, session, frame, size of the whole frame, 0
BODIES = {
    HELLO: struct.Struct("<II"),  # levels, 0
    INFO: struct.Struct("<IIdd"),  # level, number of parameters, period, command_high
    ASK: struct.Struct("<II"),  # index of a parameter, or of the rig's from the controller's own names; 0
    PARAMETER: struct.Struct("<IId48s"),  # index, number of parameters, value, name
    READY: struct.Struct("<II"),  # number of the controller's own names, 0
    SAMPLE: struct.Struct("<Qd3ddddd2I"),  # sample, time, current (3), n_wej, n_wyj, p1, p2, gear request, 0
    ANSWER: struct.Struct("<3d3d4I128s"),  # command (3), setpoint (3), status, gear, shifting, flags, message
    BYE: struct.Struct("<128s"),  # message
    OWN: struct.Struct("<IId48s16s"),  # index, WANT, SIGNAL or SETTING, a setting's first value, name, unit
}
LONGER = (SAMPLE, ANSWER)  # may have further numbers (f64) behind their body: wanted and settings, or signals
MOST = 128  # of them
TEXTS = {PARAMETER: (48,), OWN: (48, 16)}  # bytes of the text fields; of other kinds 128
LEVELS = {"duty": 1, "current": 2}
LONGEST = 2048  # bytes of any frame
AGAIN = 0.2  # s between two HELLOs of a controller that waits for a rig
KEEP_ALIVE = 0.5  # s without a frame of the rig after which the controller says HELLO again


class NoFrame(ValueError):
    """Bytes that are no frame of this protocol and version."""


def pack(kind, session, frame, *values, more=()):
    """The bytes of a frame, ``more`` numbers behind its body; texts of values are encoded and cut to their field."""
    body, sizes = BODIES[kind], iter(TEXTS.get(kind, (128,)))
    data = [value.encode()[:next(sizes) - 1] if isinstance(value, str) else value for value in values]
    size = HEADER.size + body.size + 8 * len(more)
    return (HEADER.pack(MAGIC, VERSION, kind, session, frame, size, 0) + body.pack(*data)
            + struct.pack("<%dd" % len(more), *more))


def unpack(data):
    """(kind, session, frame, values), the numbers behind a body last; NoFrame when the bytes are none."""
    if len(data) < HEADER.size:
        raise NoFrame(f"{len(data)} bytes are less than a header")
    magic, version, kind, session, frame, size, _ = HEADER.unpack_from(data)
    if magic != MAGIC:
        raise NoFrame("it does not begin with RIG1")
    if version != VERSION:
        raise NoFrame(f"it is of version {version} of the protocol, expected {VERSION}")
    if kind not in BODIES:
        raise NoFrame(f"there is no kind {kind}")
    end = HEADER.size + BODIES[kind].size
    more = (size - end) // 8 if kind in LONGER and end <= size <= end + 8 * MOST else 0
    if not len(data) == size == end + 8 * more:
        raise NoFrame(f"kind {kind} has {len(data)} bytes and says {size}, expected {end}"
                      + ", or 8 more for each further number" * (kind in LONGER))
    values = BODIES[kind].unpack_from(data, HEADER.size) + struct.unpack_from("<%dd" % more, data, end)
    return kind, session, frame, values


def text(field):
    """A text field without the zeros that fill it."""
    return field.split(b"\0", 1)[0].decode("utf-8", "replace")


class Client:
    """The controller's side: ``controller`` has initialize / step / terminate as a Python class of the rig has.

    ``wants``, ``signals`` and ``settings`` of it are used where they are there, as of a Python class.
    """

    def __init__(self, controller, host="127.0.0.1", port=PORT, levels=("duty",)):
        self.controller, self.levels = controller, sum(LEVELS[name] for name in levels)
        self.rig = (host, port)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(self.rig)
        self.session, self.running, self.last, self.answer = 0, False, 0, b""
        self.told = ""  # what the rig said last: said again by it every second, here once
        self.wants = tuple(getattr(controller, "wants", ()))
        signals = getattr(controller, "signals", ())
        self.signals = dict(signals) if isinstance(signals, dict) else dict.fromkeys(signals, "-")
        settings = dict(getattr(controller, "settings", {}))
        self.settings = tuple(settings)
        self.own = [(WANT, 0.0, name, "") for name in self.wants]
        self.own += [(SIGNAL, 0.0, name, unit) for name, unit in self.signals.items()]
        self.own += [(SETTING, float(value), name, "") for name, value in settings.items()]

    def send(self, kind, *values, frame=0):
        """One frame; a rig that is not there yet is no error."""
        try:
            self.socket.send(pack(kind, self.session, frame, *values))
        except ConnectionRefusedError:
            pass

    def receive(self, seconds):
        """The rig's next frame, None when none comes in time; a rig that is not there is silent too."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            if not select.select([self.socket], [], [], left)[0]:
                return None
            try:
                return unpack(self.socket.recv(LONGEST))
            except ConnectionRefusedError:
                time.sleep(min(0.1, max(0.0, until - time.monotonic())))
            except NoFrame as error:
                print(f"frame ignored: {error}", file=sys.stderr)
        return None

    def serve(self, once=False):
        """Answer until interrupted; once: until the end of the first run. The rig hears why it ends."""
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

    def run(self):
        """One look for the next frame; True at the end of a run."""
        if not self.running:
            self.send(HELLO, self.levels, 0)
        came = self.receive(KEEP_ALIVE if self.running and self.last else AGAIN)
        if came is None:
            if self.running and not self.last:  # until the first sample nobody knows whether it was heard
                self.send(READY, len(self.own), 0)
            elif self.running:  # is the rig still there, and the same one?
                self.send(HELLO, self.levels, 0)
            return False
        kind, session, frame, values = came
        if kind == INFO and session != self.session:
            self.begin(session, *values)
        elif kind == BYE and not self.running:
            self.tell(text(values[0]))
            time.sleep(1.0)
        elif session != self.session or not self.running:
            return False
        elif kind == ASK and values[0] < len(self.own):
            self.send(OWN, values[0], *self.own[values[0]])
        elif kind == SAMPLE:
            self.step(frame, values)
        elif kind == BYE:
            if not self.last:
                self.tell(text(values[0]))
            self.end()
            return True
        return False

    def tell(self, words):
        """What the rig says, to people, once."""
        if words != self.told:
            self.told = words
            print(f"the rig says: {words}", file=sys.stderr)

    def begin(self, session, level, count, period, command_high):
        """A rig is there: fetch its parameters, start the controller, say that it is ready."""
        if self.running:
            self.end()
        self.session = session
        parameters = {}
        for index in range(count):
            name, value = self.parameter(index)
            if name is None:
                self.session = 0
                return
            parameters[name] = value
        level = {number: name for name, number in LEVELS.items()}[level]
        try:
            self.controller.initialize(types.SimpleNamespace(
                period=period, level=level, command_high=command_high, parameters=parameters))
        except Exception as error:
            self.send(BYE, f"initialize failed: {type(error).__name__}: {error}")
            raise
        self.running, self.last, self.answer, self.told = True, 0, b"", ""
        self.send(READY, len(self.own), 0)

    def parameter(self, index):
        """(name, value) of one of the rig's parameters, asked for again when the answer is lost."""
        for _ in range(50):
            self.send(ASK, index, 0)
            came = self.receive(0.02)
            while came is not None:
                kind, session, _, values = came
                if kind == PARAMETER and session == self.session and values[0] == index:
                    return text(values[3]), values[2]
                came = self.receive(0.02)
        return None, None

    def step(self, frame, values):
        """A sample: compute once, and send the same answer again when the sample comes again."""
        if frame == self.last:
            self.socket.send(self.answer)
            return
        if frame < self.last:
            return
        sample, at, *rest = values
        others, settings = rest[9:9 + len(self.wants)], rest[9 + len(self.wants):]
        out = self.controller.step(types.SimpleNamespace(
            sample=sample, time=at, current=tuple(rest[:3]), n_wej=rest[3], n_wyj=rest[4], p1=rest[5], p2=rest[6],
            gear_request=rest[7], others=dict(zip(self.wants, others)), settings=dict(zip(self.settings, settings))))
        setpoint = (0.0, 0.0, 0.0) if out.setpoint is None else out.setpoint
        own = getattr(out, "signals", None) or {}
        self.last = frame
        self.answer = pack(ANSWER, self.session, frame, *map(float, out.command), *map(float, setpoint),
                           int(getattr(out, "status", 0)), int(out.gear), int(out.shifting), int(out.flags),
                           str(getattr(out, "message", "")),
                           more=[float(own[name]) for name in self.signals if name in own])
        self.socket.send(self.answer)

    def end(self):
        """The run is over for the controller."""
        self.running, self.session = False, 0
        self.controller.terminate()


def rig_address(words):
    """(host, port) of a program's arguments, those of a rig on this machine where they are missing.

    What is none ends the program with one sentence, exit code 2.
    """
    host, port = (list(words) + ["127.0.0.1", str(PORT)][len(words):])[:2]
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


def serve(controller, host="127.0.0.1", port=PORT, levels=("duty",), once=False):
    """Connect a controller with a rig that is started with ``--controller udp:PORT``, in any order."""
    client = Client(controller, host, port, levels)
    print(f"waiting for the rig at {host}:{port}, until Ctrl-C", flush=True)
    client.serve(once)
