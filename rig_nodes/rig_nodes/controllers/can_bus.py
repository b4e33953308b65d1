# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plug for a controller on a CAN bus: ``can:CHANNEL?interface=virtual`` (udp_multicast, socketcan ...).

load.py makes it; python-can and cantools are imported only then. The messages are those of can_database.py.
"""

from __future__ import annotations

import logging
import math
import time
from collections import deque
from typing import TYPE_CHECKING

from ..errors import RigError
from ..transmission import NEUTRAL
from . import can_database as frames
from . import j1939
from .free_running import AT_ONCE, FreeRunning, number, split_options, timeout_of
from .plug import error_text
from .record import STANDSTILL, ControllerRecord
from .seam import ControllerInputs, ControllerOutputs
from .wire import commands, currents, held_in, measured

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    import can
    from cantools.database.can import Message

    from ..testbench.configuration import RigConfig

RPM = 30.0 / math.pi
ENGAGED = 2.0  # % of slip below which a clutch counts as engaged
OPTIONS = ("interface", "bitrate", "every", "port", "timeout", "address")
NO_ADDRESS = "none"  # value of address: plain frames only
REMEMBERED = 200  # frames that are kept, to compare a second frame for the same sample with the first
FAR = 500  # counts by which two commands for one sample contradict each other: 10 mA, or 1 % of duty
LISTEN = 0.05  # s before the rig's first frame in which another rig on the bus would be heard: it sends every 1 to 50 ms
CONTRADICTIONS, WITHIN = 10, 1.0  # so many within so many s show two controllers; fewer may be a single error of one


def open_bus(channel: str, interface: str, name: str, **options: int) -> can.BusABC:
    """Open python-can's bus for classic CAN; udp_multicast stays on loopback (can_loopback.py).

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
    try:
        import can
    except ImportError:
        raise RigError(
            "CAN needs python-can, which is not installed here; install it into the rig's environment "
            "(pip install python-can cantools)"
        ) from None
    frames.need_cantools()
    logging.getLogger("can").setLevel(logging.ERROR)
    try:
        if interface == "udp_multicast":
            from .can_loopback import LoopbackBus

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


def percent(slip: float) -> float:
    """Return a slip, given as a share of the input speed, in % from 0 to 100; NaN stays NaN."""
    return slip if math.isnan(slip) else min(100.0 * abs(slip), 100.0)


class Gearbox:
    """The state of the clutches as pressures and speeds on the wires show it; it is for J1939, not for the controller.

    ``gear`` is the gear engaged last, None while a transducer has no reading; ``engaged`` is True while a clutch holds.
    """

    def __init__(self, record: ControllerRecord) -> None:
        self.gear: int | None = NEUTRAL
        self._last, self.engaged, self._record = NEUTRAL, False, record
        self._held = {
            gear.number: [(record.reader(name), kiss) for name, kiss in gear.presses]
            for gear in record.gears
            if gear.ratio is not None
        }

    def see(self, inputs: ControllerInputs, shifting: bool) -> None:
        """Take a sample; the gear stays through a shift until the new clutch holds, and is neutral when no clutch is pressed."""
        pressures = {gear: [(reader(inputs.measured), kiss) for reader, kiss in held] for gear, held in self._held.items()}
        slips = {gear: percent(self._record.slip(gear, inputs.measured)) for gear in self._held}
        if not all(map(math.isfinite, (*(p for held in pressures.values() for p, _ in held), *slips.values()))):
            self.gear, self.engaged = None, False
            return
        pressed = [gear for gear, held in pressures.items() if all(pressure > kiss for pressure, kiss in held)]
        holding = [gear for gear in pressed if slips[gear] < ENGAGED]
        self.engaged = bool(holding)
        if len(holding) == 1:
            self._last = holding[0]
        elif not pressed and not shifting:
            self._last = NEUTRAL
        self.gear = self._last


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
        self._inside = interface == "virtual"  # the bus exists only inside this process
        self._sees_programs = interface == "udp_multicast"
        self._bus = open_bus(channel, interface, f"controller {name}", **extra)
        self._prepare(address)

    def _prepare(self, address: int | None) -> None:
        import can

        self._message = can.Message
        record = self.rig_record
        database = frames.database(record)
        self._by_name = {message.name: message for message in database.messages}
        self._measured, self._currents = measured(record), currents(record)
        self._commands = commands(record, self.level)
        command = frames.COMMAND_CURRENT if self.level == "current" else frames.COMMAND_DUTY
        self._expected = {frames.FRAME_IDS[n]: self._by_name[n] for n in (frames.STATE, command)}
        self._expected_groups = {frames.GROUPS[n]: self._by_name[n] for n in (frames.STATE, command)}
        self._rig_frames = {frames.FRAME_IDS[n]: n for n in (frames.REQUEST, frames.MEASURED, frames.CURRENTS)}
        self._state: dict | None = None
        self._answers: dict[tuple[str, int], dict] = {}  # (frame, sample) -> content of the first frame
        self._contradictions: deque[float] = deque(maxlen=CONTRADICTIONS)  # time.monotonic() of the newest ones
        self._requested: int | None = None
        self._gearbox, self._shown = Gearbox(record), None
        self._node = None
        self._look_for_another()
        if address is not None:
            self._node = j1939.Node(
                address,
                self._put_group,
                {frames.GROUPS[frames.ETC1]: self._send_etc1, frames.GROUPS[frames.ETC2]: self._send_etc2},
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

    def _put(self, name: str, values: dict) -> None:
        message = self._by_name[name]
        data = message.encode(values, scaling=False, strict=False, padding=message.is_extended_frame)
        number = message.frame_id
        if message.is_extended_frame:
            number = number & ~0xFF | self._node.address
        self._put_frame(number, data, message.is_extended_frame)

    def _put_group(self, number: int, data: bytes) -> None:
        self._put_frame(number, data, True)

    def _put_frame(self, number: int, data: bytes, extended: bool) -> None:
        try:
            self._bus.send(self._message(arbitration_id=number, data=data, is_extended_id=extended, is_fd=False))
        except Exception as error:  # a full queue or a loose cable: the driver has error classes of its own
            self.ignored.add(f"a frame could not be sent ({error_text(error)})")

    def _send(self, inputs: ControllerInputs) -> None:
        sample, request = inputs.sample, inputs.gear_request
        if request != self._requested or sample % frames.CYCLES[frames.REQUEST] == 0:
            self._requested = request
            self._put(frames.REQUEST, {"gear_request": request, "level": int(self.level == "current")})
        if sample % self._every == 0:
            self._put(frames.MEASURED, _raw(self._measured, inputs.measured))
            self._put(frames.CURRENTS, {"sample": sample & 0xFFFF, **_raw(self._currents, inputs.current)})
        self._gearbox.see(inputs, self.shifting)
        self._shown = inputs
        if self._node is None or not self._node.may_send:
            return
        if sample % frames.CYCLES[frames.ETC1] == 0:
            self._send_etc1()
        if sample % frames.CYCLES[frames.ETC2] == 0:
            self._send_etc2()

    def _send_etc1(self) -> None:
        """Send ETC1 with the newest sample, nothing before the first."""
        if self._shown is None:
            return
        gearbox, measured_now = self._gearbox, self._shown.measured
        n_in, n_out = self.rig_record.speeds(measured_now)
        slip = percent(self.rig_record.slip(self.gear, measured_now))
        shifting = j1939.NOT_AVAILABLE if not self._was_here else j1939.ERROR if self._silence_reported else int(self.shifting)
        self._put(
            frames.ETC1,
            {
                "TransDrivelineEngaged": j1939.ERROR if gearbox.gear is None else int(gearbox.engaged),
                "TransShiftInProcess": shifting,
                "TransOutputShaftSpeed": _two_bytes(n_out * RPM / 0.125),
                "PercentClutchSlip": round(slip / 0.4) if math.isfinite(slip) else j1939.ERROR_1,
                "TransInputShaftSpeed": _two_bytes(n_in * RPM / 0.125),
            },
        )

    def _send_etc2(self) -> None:
        """Send ETC2 with the newest sample, nothing before the first."""
        if self._shown is None:
            return
        gear = self._gearbox.gear
        n_in, n_out = self.rig_record.speeds(self._shown.measured)
        ratio = j1939.NONE_2  # at standstill there is no ratio
        if not math.isfinite(n_in) or not math.isfinite(n_out):
            ratio = j1939.ERROR_2
        elif n_out > STANDSTILL:
            ratio = _two_bytes(n_in / n_out / 0.001)
        self._put(
            frames.ETC2,
            {
                "TransSelectedGear": self._shown.gear_request + 125,
                "TransActualGearRatio": ratio,
                "TransCurrentGear": j1939.ERROR_1 if gear is None else gear + 125,
            },
        )

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
                self._take(self._expected[number], frame, self._program(frame))
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
                f"{self._program(frame) if self._sees_programs else 'another program'} too; give each rig a bus of its own"
                + (", for example with &port=N" if self._sees_programs else "")
            )

    def _program(self, frame: can.Message) -> str:
        """Return the sender of a plain frame as far as it is known: on udp_multicast the port of its program."""
        return f"the program on port {frame.channel}" if self._sees_programs else "plain frames"

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
            self._state = raw
            return
        if self._state is None or self._state["sample"] != raw["sample"]:
            self.ignored.add(f"frame {message.name} came without the {frames.STATE} of its sample before it")
            return
        command = [wire.decode(raw[wire.name]) for wire in self._commands]
        state, self._state = self._state, None
        self.received(
            ControllerOutputs(
                held_in(command, self.info, self._commands),
                None,
                state["gear"],
                state["shifting"],
                state["flags"],
                state["status"],
                "the controller reports it on the bus",
            )
        )

    def _compare(self, name: str, raw: dict) -> None:
        """Detect a second controller: the bus does not name senders, but one controller does not answer a sample in two ways."""
        first = self._answers.setdefault((name, raw["sample"]), raw)
        if len(self._answers) > REMEMBERED:
            del self._answers[next(iter(self._answers))]
        keys = ("gear", "shifting") if name == frames.STATE else [wire.name for wire in self._commands]
        if max(abs(raw[key] - first[key]) for key in keys) <= (0 if name == frames.STATE else FAR):
            return
        now = time.monotonic()
        self._contradictions.append(now)
        if len(self._contradictions) == CONTRADICTIONS and now - self._contradictions[0] < WITHIN:
            self.conflict = (
                f"another controller is at work on {self.place}: sample {raw['sample']} and others got "
                "two different answers; end one of the two controllers"
            )

    def _end(self) -> None:
        self._bus.shutdown()


def _raw(wires: list, values: Iterable[float]) -> dict[str, int]:
    """Return the raw numbers by the names of their wires."""
    return {wire.name: wire.encode(value) for wire, value in zip(wires, values, strict=True)}


def _two_bytes(value: float) -> int:
    """Return the raw J1939 number of two bytes, below the reserved range; "error" for a value that is no finite number."""
    return round(min(max(value, 0), j1939.HIGHEST_2)) if math.isfinite(value) else j1939.ERROR_2
