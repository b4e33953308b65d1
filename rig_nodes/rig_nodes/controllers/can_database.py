"""The CAN database of the rig, made from the signal catalogue: what the plug sends and takes, and J1939 ETC1 / ETC2.

Used by the plug (can_bus.py), by `rig export dbc` and by the example controller. cantools is imported when it is asked for.
"""

from __future__ import annotations

from functools import lru_cache

from ..errors import RigError
from .seam import OUTPUTS
from .wire import Wire, commands, measured

REQUEST, SHAFTS, CURRENTS = "RIG_REQUEST", "RIG_SHAFTS", "RIG_CURRENTS"
STATE, COMMAND_CURRENT, COMMAND_DUTY = "CONTROL_STATE", "CONTROL_COMMAND_CURRENT", "CONTROL_COMMAND_DUTY"
ETC1, ETC2 = "ETC1", "ETC2"
FRAME_IDS = {REQUEST: 0x100, SHAFTS: 0x101, CURRENTS: 0x102, STATE: 0x200, COMMAND_CURRENT: 0x201, COMMAND_DUTY: 0x202}
# J1939-71: priority 3 and 6, PGN 61442 and 61445, source address 3 (transmission)
J1939_IDS = {ETC1: 0x0CF00203, ETC2: 0x18F00503}
CYCLES = {REQUEST: 10, SHAFTS: 1, CURRENTS: 1, STATE: 1, COMMAND_CURRENT: 1, COMMAND_DUTY: 1, ETC1: 10, ETC2: 100}  # ms
RIG, CONTROLLER = "RIG", "CONTROLLER"
GEARS = {0: "neutral", 1: "I", 2: "II"}


def need_cantools():
    """The module cantools; RigError when it is not installed."""
    try:
        import cantools
    except ImportError:
        raise RigError("CAN needs cantools, which is not installed here; install it into the rig's environment "
                       "(pip install cantools python-can)") from None
    return cantools


@lru_cache(maxsize=1)
def database():
    """cantools' database of all messages."""
    need_cantools()
    from cantools.database.can import Database, Node

    database = Database(messages=[*_rig_messages(), *_controller_messages(), *_j1939_messages()],
                        nodes=[Node(RIG, "The virtual test rig"), Node(CONTROLLER, "Your shift controller")], version="1")
    database.refresh()
    return database


def dbc_text() -> str:
    """The database as a DBC file."""
    return database().as_dbc_string()


def _signal(name: str, start: int, length: int, text: str, scale: float = 1, offset: float = 0, unit: str | None = None,
            signed: bool = False, limits: tuple | None = None, choices: dict | None = None):
    from collections import OrderedDict

    from cantools.database.can import Signal
    from cantools.database.conversion import BaseConversion

    conversion = BaseConversion.factory(scale, offset, OrderedDict(choices) if choices else None)
    low, high = limits or (None, None)
    return Signal(name, start, length, is_signed=signed, conversion=conversion, minimum=low, maximum=high, unit=unit,
                  comment=text)


def _wire(wire: Wire, start: int):
    return _signal(wire.name, start, 16, wire.text, wire.step, 0, wire.unit, wire.raw[0] < 0, wire.range)


def _message(name: str, sender: str, signals: list, text: str, j1939: bool = False):
    from cantools.database.can import Message

    return Message((J1939_IDS if j1939 else FRAME_IDS)[name], name, 8, signals, comment=text, senders=[sender],
                   cycle_time=CYCLES[name], is_extended_frame=j1939, unused_bit_pattern=0xFF if j1939 else 0)


def _rig_messages() -> list:
    wires = {wire.name: wire for wire in measured()}
    sample = _signal("sample", 0, 16, "Controller sample, low 16 bits; the controller sends it back.")
    return [
        _message(REQUEST, RIG, [
            _signal("gear_request", 0, 8, "Gear ordered last; stays until the next order, or a trip, then 0.", choices=GEARS),
            _signal("level", 8, 8, "Level of this run: which of the two commands is used.", choices={0: "duty", 1: "current"}),
        ], "Every 10 ms and when the order changes."),
        _message(SHAFTS, RIG, [_wire(wires[name], 16 * k) for k, name in enumerate(("n_wej", "n_wyj", "p1", "p2"))],
                 "Speeds of both shafts and pressures of both clutches."),
        _message(CURRENTS, RIG, [sample, *(_wire(wires[f"current_{k}"], 16 * k) for k in range(1, OUTPUTS + 1))],
                 "Coil currents; the last message of a sample."),
    ]


def _controller_messages() -> list:
    echo = "Sample that is answered, low 16 bits."
    state = _message(STATE, CONTROLLER, [
        _signal("sample", 0, 16, echo), _signal("gear", 16, 8, "Gear taken last.", choices=GEARS),
        _signal("shifting", 24, 8, "1: a shift is still running."),
        _signal("flags", 32, 8, "Bit k: at level current, output k stays on at a setpoint of zero."),
        _signal("status", 40, 8, "0: an answer, 2: error, 3: fatal; the rig trips with the last two."),
    ], "Before the command that it belongs to.")
    out = [state]
    for name, level in ((COMMAND_CURRENT, "current"), (COMMAND_DUTY, "duty")):
        out.append(_message(name, CONTROLLER, [
            _signal("sample", 0, 16, echo), *(_wire(wire, 16 * k) for k, wire in enumerate(commands(level), 1))],
            f"Completes an answer at level {level}."))
    return out


def _j1939_messages() -> list:
    """Those signals of ETC1 and ETC2 that the rig knows, with the scaling of J1939-71; the others are not available."""
    bits = {0: "off", 1: "on", 3: "not available"}
    return [
        _message(ETC1, RIG, [
            _signal("TransDrivelineEngaged", 0, 2, "SPN 560", choices=bits),
            _signal("TransShiftInProcess", 4, 2, "SPN 574", choices=bits),
            _signal("TransOutputShaftSpeed", 8, 16, "SPN 191", 0.125, 0, "rpm", limits=(0, 8031.875)),
            _signal("PercentClutchSlip", 24, 8, "SPN 522", 0.4, 0, "%", limits=(0, 100)),
            _signal("TransInputShaftSpeed", 40, 16, "SPN 161", 0.125, 0, "rpm", limits=(0, 8031.875)),
        ], "J1939 Electronic Transmission Controller 1, PGN 61442.", True),
        _message(ETC2, RIG, [
            _signal("TransSelectedGear", 0, 8, "SPN 524", 1, -125, limits=(-125, 125)),
            _signal("TransActualGearRatio", 8, 16, "SPN 526", 0.001, 0, limits=(0, 64.255)),
            _signal("TransCurrentGear", 24, 8, "SPN 523", 1, -125, limits=(-125, 125)),
        ], "J1939 Electronic Transmission Controller 2, PGN 61445.", True),
    ]
