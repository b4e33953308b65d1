"""The plug for a controller on a CAN bus: ``can:CHANNEL?interface=virtual`` (udp_multicast, socketcan ...).

Made by load.py; python-can and cantools are imported then. The messages are those of can_database.py.
"""

from __future__ import annotations

import logging
import math
import time
from collections import deque

from ..alfa46.settings import Alfa46Config
from ..errors import RigError
from ..plant.gearbox import RATIO_I, RATIO_II
from . import can_database as frames
from .free_running import FreeRunning, number, split_options
from .plug import said
from .seam import ControllerInputs, ControllerOutputs, Status
from .wire import commands, held_in, measured, values_of

RPM = 30.0 / math.pi
RATIOS = {1: RATIO_I, 2: RATIO_II}
STANDSTILL = 10.0 / RPM  # rad/s, below which no slip and no ratio is told
ENGAGED = 2.0  # % of slip below which the driveline counts as engaged
OPTIONS = ("interface", "bitrate", "every", "port")
REMEMBERED = 200  # frames of which a second one for the same sample is compared with the first
FAR = 500  # counts by which two commands for one sample contradict each other: 10 mA, or 1 % of duty
CONTRADICTIONS, WITHIN = 10, 1.0  # so many within so many s are two controllers, and none that stumbled once


def open_bus(channel: str, interface: str, name: str, **options):
    """python-can's bus, classic CAN; on udp_multicast the packets stay on this machine. RigError when there is none."""
    try:
        import can
    except ImportError:
        raise RigError("CAN needs python-can, which is not installed here; install it into the rig's environment "
                       "(pip install python-can cantools)") from None
    frames.need_cantools()
    if interface == "udp_multicast":
        options = {"hop_limit": 0, "fd": False, **options}
    logging.getLogger("can").setLevel(logging.ERROR)
    try:
        return can.Bus(channel=channel, interface=interface, **options)
    except Exception as error:  # python-can and its drivers raise what they like
        raise RigError(f"{name}: the bus {channel} cannot be opened with the interface {interface}: {said(error)}") from None


def slip_percent(gear: int, n_wej: float, n_wyj: float) -> float:
    """Slip of the clutch of a gear in % of the input speed, 0 to 100; 0 in neutral and at standstill. rad/s in."""
    if gear not in RATIOS or not (n_wej >= STANDSTILL and math.isfinite(n_wyj)):
        return 0.0
    return min(100.0 * abs(1.0 - RATIOS[gear] * n_wyj / n_wej), 100.0)


class CanBus(FreeRunning):
    """A controller at the other end of a CAN bus.

    Options: interface (python-can's name, default socketcan), bitrate [bit/s], every (samples between two messages,
    default 1), port of udp_multicast.
    """

    def __init__(self, rest: str, config: Alfa46Config, level: str | None = None):
        name = f"can:{rest}"
        channel, options = split_options(rest, name, OPTIONS)
        interface = options.get("interface", "socketcan")
        self._every = int(number(options, "every", 1, name, 1, 50))
        extra = {key: int(number(options, key, 0, name, 1, 1e7)) for key in ("bitrate", "port") if key in options}
        super().__init__(name, config, level, f"CAN {interface} {channel}")
        self._inside = interface == "virtual"  # the bus is inside this process
        self._bus = open_bus(channel, interface, f"controller {name}", **extra)
        self._prepare()

    def _prepare(self) -> None:
        import can

        self._message = can.Message
        database = frames.database()
        self._by_name = {message.name: message for message in database.messages}
        self._wires = measured()
        self._commands = commands(self.level)
        command = frames.COMMAND_CURRENT if self.level == "current" else frames.COMMAND_DUTY
        self._expected = {frames.FRAME_IDS[n]: self._by_name[n] for n in (frames.STATE, command)}
        self._state: dict | None = None
        self._answers: dict[tuple[str, int], dict] = {}  # (frame, sample) -> what came first
        self._contradictions: deque[float] = deque(maxlen=CONTRADICTIONS)  # time.monotonic() of the newest
        self._another = ""  # why the rig trips: another controller is at work
        self._requested: int | None = None

    def pace(self, step_timeout: float | None, real_time: bool = False) -> None:
        super().pace(step_timeout, real_time)
        if self._inside:
            self.say(f"{self.place} is a bus inside the rig's process: no other program can join it, and a wait for one "
                     "is in vain; interface=udp_multicast reaches other programs")

    # ---- out

    def _put(self, name: str, values: dict) -> None:
        message = self._by_name[name]
        extended = message.is_extended_frame
        data = message.encode(values, scaling=False, strict=False, padding=extended)
        try:
            self._bus.send(self._message(arbitration_id=message.frame_id, data=data, is_extended_id=extended,
                                         is_fd=False))
        except Exception as error:  # a full queue, a cable that is off: the driver's own classes
            self.fault(f"a frame could not be sent ({said(error)})")

    def _send(self, inputs: ControllerInputs) -> None:
        sample, request = inputs.sample, inputs.gear_request
        if request != self._requested or sample % frames.CYCLES[frames.REQUEST] == 0:
            self._requested = request
            self._put(frames.REQUEST, {"gear_request": request, "level": int(self.level == "current")})
        if sample % self._every == 0:
            raw = {wire.name: wire.encode(value) for wire, value in zip(self._wires, values_of(inputs), strict=True)}
            self._put(frames.SHAFTS, {name: raw[name] for name in ("n_wej", "n_wyj", "p1", "p2")})
            self._put(frames.CURRENTS, {"sample": sample & 0xFFFF,
                                        **{f"current_{k}": raw[f"current_{k}"] for k in (1, 2, 3)}})
        if sample % frames.CYCLES[frames.ETC1] == 0:
            self._put(frames.ETC1, self._etc1(inputs))
        if sample % frames.CYCLES[frames.ETC2] == 0:
            self._put(frames.ETC2, self._etc2(inputs))

    def _etc1(self, inputs: ControllerInputs) -> dict:
        slip = slip_percent(self.gear, inputs.n_wej, inputs.n_wyj)
        return {"TransDrivelineEngaged": int(self.gear > 0 and slip < ENGAGED), "TransShiftInProcess": int(self.shifting),
                "TransOutputShaftSpeed": _speed(inputs.n_wyj), "PercentClutchSlip": round(slip / 0.4),
                "TransInputShaftSpeed": _speed(inputs.n_wej)}

    def _etc2(self, inputs: ControllerInputs) -> dict:
        moving = inputs.n_wyj > STANDSTILL and math.isfinite(inputs.n_wej / inputs.n_wyj)
        ratio = round(inputs.n_wej / inputs.n_wyj / 0.001) if moving else 0xFFFF
        return {"TransSelectedGear": inputs.gear_request + 125, "TransActualGearRatio": min(max(ratio, 0), 0xFFFF),
                "TransCurrentGear": self.gear + 125}

    # ---- in

    def _listen(self, until: float) -> None:
        while True:
            rest = until - time.monotonic()
            frame = self._bus.recv(max(rest, 0.0))
            if frame is None:
                if time.monotonic() >= until:
                    return
                continue
            if not frame.is_extended_id and not frame.is_error_frame and frame.arbitration_id in self._expected:
                self._take(frame)

    def _take(self, frame) -> None:
        message = self._expected[frame.arbitration_id]
        if len(frame.data) != message.length or frame.is_remote_frame:
            self.fault(f"frame {message.name} (0x{message.frame_id:x}) came with {len(frame.data)} bytes instead of "
                       f"{message.length}")
            return
        raw = message.decode(bytes(frame.data), decode_choices=False, scaling=False)
        self._compare(message.name, raw)
        if message.name == frames.STATE:
            self._state = raw
            return
        if self._state is None or self._state["sample"] != raw["sample"]:
            self.fault(f"frame {message.name} came without the {frames.STATE} of its sample before it")
            return
        command = [wire.decode(raw[wire.name]) for wire in self._commands]
        state, self._state = self._state, None
        self.heard(ControllerOutputs(held_in(command, self.info), None, state["gear"], bool(state["shifting"]),
                                     state["flags"], state["status"], "the controller says so on the bus"))

    def _compare(self, name: str, raw: dict) -> None:
        """A bus does not tell who sent a frame, but one controller does not answer one sample in two ways."""
        first = self._answers.setdefault((name, raw["sample"]), raw)
        if len(self._answers) > REMEMBERED:
            del self._answers[next(iter(self._answers))]
        keys = ("gear", "shifting") if name == frames.STATE else [wire.name for wire in self._commands]
        if max(abs(raw[key] - first[key]) for key in keys) <= (0 if name == frames.STATE else FAR):
            return
        now = time.monotonic()
        self._contradictions.append(now)
        if len(self._contradictions) == CONTRADICTIONS and now - self._contradictions[0] < WITHIN:
            self._another = (f"another controller is at work on {self.place}: sample {raw['sample']} and others got "
                             "two different answers; end one of the two controllers")

    def _answer(self, inputs: ControllerInputs) -> ControllerOutputs:
        out = super()._answer(inputs)
        if self._another:
            self._fail(Status.ERROR, inputs.sample, self._another)
        return out

    def _end(self) -> None:
        self._bus.shutdown()


def _speed(value: float) -> int:
    """Raw J1939 shaft speed of a speed in rad/s; "not available" for what is no number."""
    return round(min(max(value * RPM / 0.125, 0), 0xFAFF)) if math.isfinite(value) else 0xFFFF
