# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plug for a controller on a CAN bus: ``can:CHANNEL?interface=virtual`` (udp_multicast, socketcan ...).

load.py makes it; python-can and cantools are imported only then. The messages are those of database.py; frames.py makes
the rig's.
"""

from __future__ import annotations

import contextlib
import logging
import time
from collections import deque
from typing import TYPE_CHECKING

from ...base import RigError
from ..free_running import AT_ONCE, FreeRunning, number, split_options, timeout_of
from ..plug import error_text
from ..seam import ControllerInputs
from ..wire import commands
from . import database as frames
from . import j1939
from .dm1 import DM1, ActiveCode, dm1_frames
from .frames import RigFrames

if TYPE_CHECKING:
    from collections.abc import Callable

    import can
    from cantools.database.can import Message

    from ...rig import RigConfig

OPTIONS = ("interface", "bitrate", "every", "port", "timeout", "address")
NO_ADDRESS = "none"  # value of address: plain frames only
REMEMBERED = 200  # frames that are kept, to compare a second frame for the same sample with the first
FAR = 500  # counts by which two commands for one sample contradict each other: 10 mA, or 1 % of duty
LISTEN = 0.05  # s before the rig's first frame in which another rig on the bus would be heard: it sends every 1 to 50 ms
CONTRADICTIONS, WITHIN = 10, 1.0  # so many within so many s show two controllers; fewer may be a single error of one


def open_bus(channel: str, interface: str, name: str, **options: int) -> can.BusABC:
    """Open python-can's bus for classic CAN; udp_multicast stays on loopback (loopback.py).

    Parameters
    ----------
    channel : str
        The bus, as the interface names it.
    interface : str
        python-can's name of the interface.
    name : str
        The caller's name, for the error's sentence.
    **options : int
        Further options of the interface, such as bitrate [bit/s] or port.

    Returns
    -------
    can.BusABC
        The open bus.

    Raises
    ------
    RigError
        When python-can is not installed or the bus cannot be opened.
    """
    can = frames.need_can()
    logging.getLogger("can").setLevel(logging.ERROR)
    try:
        if interface == "udp_multicast":
            from .loopback import LoopbackBus

            return LoopbackBus(channel, **options)
        return can.Bus(channel=channel, interface=interface, **options)
    except Exception as error:  # python-can and its drivers raise errors of many classes
        raise RigError(f"{name}: the bus {channel} cannot be opened with the interface {interface}: {error_text(error)}") from None


def receive(bus: can.BusABC, seconds: float, fault: Callable[[str], None]) -> can.Message | None:
    """Return the bus's next frame.

    Parameters
    ----------
    bus : can.BusABC
        The open bus.
    seconds : float
        Longest wait [s].
    fault : callable
        Called with a sentence when what came cannot be read.

    Returns
    -------
    can.Message or None
        None when no readable frame comes in time.
    """
    try:
        return bus.recv(seconds)
    except Exception as error:  # foreign bytes or a loose cable: the driver has error classes of its own
        fault(f"what came could not be read ({error_text(error)})")
        return None


class CanBus(FreeRunning):
    """A controller at the other end of a CAN bus.

    Options: interface (python-can's name, default socketcan), bitrate [bit/s], every (samples between two messages,
    default 1), port of udp_multicast, timeout [s], address (the rig's J1939 source address, or none).
    """

    def __init__(self, rest: str, config: RigConfig, level: str | None = None) -> None:
        name = f"can:{rest}"
        channel, options = split_options(rest, name, OPTIONS)
        interface = options.get("interface", "socketcan")
        self._every = int(number(options, "every", 1, name, 1, 50))
        extra = {key: int(number(options, key, 0, name, 1, 1e7)) for key in ("bitrate", "port") if key in options}
        address = None
        if options.get("address") != NO_ADDRESS:
            address = int(number(options, "address", frames.ADDRESS, name, 0, j1939.NULL - 1))
        super().__init__(name, config, level, f"CAN {interface} {channel}", timeout_of(options, name))
        self._active = ActiveCode(config)
        self._inside = interface == "virtual"  # the bus exists only inside this process
        self._sees_programs = interface == "udp_multicast"
        self._bus = open_bus(channel, interface, f"controller {name}", **extra)
        self._prepare(address)

    def _prepare(self, address: int | None) -> None:
        import can

        self._message = can.Message
        record = self.rig_record
        by_name = {message.name: message for message in frames.database(record).messages}
        self._commands = commands(record, self.level)
        self._last = frames.COMMAND_CURRENT if self.level == "current" else frames.COMMAND_DUTY
        self._parts = [name for name, _ in frames.split(self._last, self._commands)]  # frames of a command; the last completes it
        expected = (frames.STATE, *self._parts)
        self._expected = {frames.FRAME_IDS[n]: by_name[n] for n in expected}
        self._expected_groups = {frames.GROUPS[n]: by_name[n] for n in expected}
        sent = {m.name for m in by_name.values() if m.senders == [frames.RIG]} & frames.FRAME_IDS.keys()
        self._rig_frames = {frames.FRAME_IDS[n]: n for n in sent}
        self._state: dict | None = None
        self._raw: dict[str, dict] = {}  # frames of the command that is not complete yet
        self._round, self._sent = 0, 0  # samples given so far, and the low 16 bits of the one whose measurements were sent last
        self._answers: dict[tuple[str, int], tuple[int, dict]] = {}  # (frame, sample) -> round and content of a first frame
        self._contradictions: deque[tuple[int, float]] = deque(maxlen=CONTRADICTIONS)  # round and time.monotonic() of the newest
        self._node = None
        self._look_for_another()
        self._frames = RigFrames(record, self.level, self._put_frame, self._every, frames.ADDRESS if address is None else address)
        if address is not None:
            self._node = j1939.Node(
                address,
                self._put_group,
                {frames.GROUPS[frames.ETC1]: self._etc1, frames.GROUPS[frames.ETC2]: self._frames.etc2, DM1: self._dm1},
                self._lost_address,
            )

    def _look_for_another(self) -> None:
        """Listen before the rig itself sends; RigError when a rig is at work on the bus already."""
        until = time.monotonic() + LISTEN
        while not self.conflict and (left := until - time.monotonic()) > 0.0:
            frame = receive(self._bus, left, lambda _: None)  # what cannot be read is reported when the run is on
            if frame is not None and not frame.is_extended_id and frame.arbitration_id in self._rig_frames:
                self._foreign(frame)
        if self.conflict:
            with contextlib.suppress(Exception):  # the driver has error classes of its own, and the conflict is what counts
                self._bus.shutdown()
            raise RigError(f"controller {self.name}: {self.conflict}")

    def pace(self, step_timeout: float | None, real_time: bool = False) -> None:
        """Set the pace as in every plug; report a bus that no other program can join."""
        super().pace(step_timeout, real_time)
        if self._inside:
            self.say(
                f"{self.place} is a bus inside the rig's process: no other program can join it, and a wait for one "
                "is in vain; interface=udp_multicast reaches other programs"
            )

    # ---- out

    def _put_group(self, number: int, data: bytes) -> None:
        self._put_frame(number, data, True)

    def _put_frame(self, number: int, data: bytes, extended: bool) -> None:
        try:
            self._bus.send(self._message(arbitration_id=number, data=data, is_extended_id=extended, is_fd=False))
        except Exception as error:  # a full queue or a loose cable: the driver has error classes of its own
            self.ignored.add(f"a frame could not be sent ({error_text(error)})")

    def _send(self, inputs: ControllerInputs) -> None:
        self._round += 1
        if inputs.sample % self._every == 0:
            self._sent = inputs.sample & 0xFFFF
        self._tell()
        groups = self._node is not None and self._node.may_send
        self._frames.take(inputs, self.shifting, groups)
        for frame, data in self._active.due(inputs.sample, self._node.address) if groups else ():
            self._put_group(frame, data)

    def notice(self, reason: str) -> None:
        """Send the trouble code of the rig's trip, until there is none."""
        self._active.take(reason)

    def _tell(self) -> None:
        """Give the frames of J1939 what the controller has reported."""
        shifting = j1939.NOT_AVAILABLE if not self._was_here else j1939.ERROR if self._silence_reported else int(self.shifting)
        self._frames.gear, self._frames.shifting = self.gear, shifting

    def _etc1(self) -> None:
        self._tell()
        self._frames.etc1()

    def _dm1(self) -> None:
        for frame, data in dm1_frames(self._active.codes, self._node.address):
            self._put_group(frame, data)

    def _lost_address(self, text: str) -> None:
        self.conflict = f"{text}; choose another one with &address=N, or none with &address={NO_ADDRESS}"

    # ---- in

    def _listen(self, until: float) -> None:
        late = 0  # frames taken after that time
        while late < AT_ONCE:
            unread: list[str] = []
            frame = receive(self._bus, max(until - time.monotonic(), 0.0), unread.append)
            for why in unread:
                self.ignored.add(why)
            if frame is not None and not frame.is_error_frame:
                self._hear(frame)
            if time.monotonic() >= until:
                if frame is None and not unread:
                    return
                late += 1

    def _hear(self, frame: can.Message) -> None:
        number = frame.arbitration_id
        if not frame.is_extended_id:
            if number in self._expected:
                self._take(self._expected[number], frame, self._program())
            elif number in self._rig_frames:
                self._foreign(frame)
        elif self._node is not None:
            source = j1939.parts(number)
            if source.source == self._node.address and source.pgn != j1939.ADDRESS_CLAIMED and frame.is_rx:
                self._lost_address(f"another node sends from the J1939 address {source.source} of the rig (PGN {source.pgn})")
            elif source.pgn in self._expected_groups:
                self._take(self._expected_groups[source.pgn], frame, f"J1939 address {source.source}")
            else:
                self._node.received(number, bytes(frame.data))

    def _foreign(self, frame: can.Message) -> None:
        """Detect another rig: on one bus a frame has one sender, and this one's is the rig itself."""
        if frame.is_rx and not frame.is_remote_frame:  # a driver may give back what the rig has sent
            number = frame.arbitration_id
            self.conflict = (
                f"another rig is at work on {self.place}: the frame {self._rig_frames[number]} (0x{number:x}) comes from "
                f"{self._program() if self._sees_programs else 'another program'} too; give each rig a bus of its own"
                + (", for example another group" if self._sees_programs else "")
            )

    def _program(self) -> str:
        """Return the sender of a plain frame as far as it is known: on udp_multicast the port of its program."""
        return f"the program on port {getattr(self._bus, 'sender', 0)}" if self._sees_programs else "plain frames"

    def _take(self, message: Message, frame: can.Message, who: str) -> None:
        if not self.may_command(who):
            self.refuse(who)
            return
        if len(frame.data) != message.length or frame.is_remote_frame:
            self.ignored.add(
                f"frame {message.name} (0x{message.frame_id:x}) came with {len(frame.data)} bytes instead of {message.length}"
            )
            return
        self.commands_now(who)
        raw = message.decode_simple(bytes(frame.data), decode_choices=False, scaling=False)
        self._compare(message.name, raw)
        if message.name == frames.STATE:
            self._state, self._raw = raw, {}
            return
        self._raw[message.name] = raw
        if message.name != self._last:
            return
        before = {frames.STATE: self._state, **{name: self._raw.get(name) for name in self._parts}}
        for name, one in before.items():
            if one is None or one["sample"] != raw["sample"]:
                self.ignored.add(f"frame {message.name} came without the {name} of its sample before it")
                return
        numbers = {key: value for one in self._raw.values() for key, value in one.items()}
        state, self._state = self._state, None
        reported = [state[key] for key in ("gear", "shifting", "flags", "status")]
        self.received_raw([numbers[wire.name] for wire in self._commands], self._commands, reported, "on the bus")

    def _compare(self, name: str, raw: dict) -> None:
        """Detect a second controller: the bus does not name senders, but one controller does not answer a sample in two ways.

        It may do so in a later round while its sample is still the newest one, with option every: it goes on by its own clock.
        """
        sample = raw["sample"]
        came, first = self._answers.get((name, sample), (self._round, raw))
        if came != self._round and sample == self._sent:
            came, first = self._round, raw
        self._answers[name, sample] = came, first
        if len(self._answers) > REMEMBERED:
            del self._answers[next(iter(self._answers))]
        keys = ("gear", "shifting") if name == frames.STATE else raw.keys() - {"sample"}
        if max(abs(raw[key] - first[key]) for key in keys) <= (0 if name == frames.STATE else FAR):
            return
        if self._contradictions and self._contradictions[-1][0] == self._round:
            return  # a rig that was held up finds many answers of one controller in a round
        now = time.monotonic()
        self._contradictions.append((self._round, now))
        if len(self._contradictions) == CONTRADICTIONS and now - self._contradictions[0][1] < WITHIN:
            self.conflict = (
                f"another controller is at work on {self.place}: sample {sample} and others got "
                "two different answers; end one of the two controllers"
            )

    def _end(self) -> None:
        self._bus.shutdown()
