# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The CAN database of a rig, made from its record: the messages that the plug sends and takes, and J1939 ETC1 / ETC2.

It is used by the plug (bus.py), by `rig export dbc` and by the example controller. cantools is imported only when
it is needed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...base import RigError, optional
from ..record import ControllerRecord
from ..wire import Wire, commands, currents, measured
from . import j1939

if TYPE_CHECKING:
    from types import ModuleType

    from cantools.database.can import Database, Message, Signal
    from cantools.database.can.formats.dbc import DbcSpecifics

REQUEST, MEASURED, CURRENTS = "RIG_REQUEST", "RIG_MEASURED", "RIG_CURRENTS"
STATE, COMMAND_CURRENT, COMMAND_DUTY = "CONTROL_STATE", "CONTROL_COMMAND_CURRENT", "CONTROL_COMMAND_DUTY"
ETC1, ETC2 = "ETC1", "ETC2"
CLAIM, ACKNOWLEDGE = "ADDRESS_CLAIMED", "ACKNOWLEDGEMENT"
FRAME_IDS = {REQUEST: 0x100, MEASURED: 0x101, CURRENTS: 0x102, STATE: 0x200, COMMAND_CURRENT: 0x201, COMMAND_DUTY: 0x202}
ADDRESS = 3  # J1939 source address of the rig: transmission
# J1939-71: ETC1 and ETC2; J1939-21: proprietary B, for a controller that sends its frames as J1939 groups
GROUPS = {ETC1: 61442, ETC2: 61445, STATE: 65296, COMMAND_CURRENT: 65297, COMMAND_DUTY: 65298}
GROUPS |= {CLAIM: j1939.ADDRESS_CLAIMED, ACKNOWLEDGE: j1939.ACKNOWLEDGEMENT}
PRIORITIES = {ETC1: 3, ETC2: 6, STATE: 3, COMMAND_CURRENT: 3, COMMAND_DUTY: 3, CLAIM: j1939.PRIORITY, ACKNOWLEDGE: j1939.PRIORITY}
AS_GROUP = "_J1939"  # follows the name of a controller's frame in its form as a J1939 group
CYCLES = {REQUEST: 10, MEASURED: 1, CURRENTS: 1, STATE: 1, COMMAND_CURRENT: 1, COMMAND_DUTY: 1, ETC1: 10, ETC2: 100}  # ms
CYCLES |= {CLAIM: 0, ACKNOWLEDGE: 0}  # on request
RIG, CONTROLLER = "RIG", "CONTROLLER"
# Numbers for which a frame of 8 bytes has room, in RIG_MEASURED or beside the sample's number; more of them are in frames _2 to _4.
MEASURED_ROOM, ROOM, MOST_FRAMES = 4, 3, 4
for _table, _step in ((FRAME_IDS, 0x10), (GROUPS, 0x10), (PRIORITIES, 0), (CYCLES, 0)):
    for _name in (MEASURED, CURRENTS, COMMAND_CURRENT, COMMAND_DUTY):
        if _name in _table:
            _table |= {f"{_name}_{k + 1}": _table[_name] + k * _step for k in range(1, MOST_FRAMES)}


def split(name: str, wires: list[Wire]) -> list[tuple[str, list[Wire]]]:
    """Return the frames that carry these wires, each with its name and its wires, in the order in which they are sent.

    The frame that is called ``name`` has the first wires and comes last.
    """
    room = MEASURED_ROOM if name == MEASURED else ROOM
    places = range(0, len(wires), room)
    return [(f"{name}_{k // room + 1}" if k else name, wires[k : k + room]) for k in reversed(places)]


def need_can() -> ModuleType:
    """Return the module can of python-can; RigError when it or cantools is not installed."""
    need_cantools()
    return optional("can", "plugs")


def need_cantools() -> ModuleType:
    """Return the module cantools; RigError when it is not installed."""
    return optional("cantools", "plugs")


def database(record: ControllerRecord) -> Database:
    """Return cantools' database of all messages.

    Parameters
    ----------
    record : ControllerRecord
        The rig's record.

    Returns
    -------
    Database
        The messages of the rig, of the controller and of J1939.

    Raises
    ------
    RigError
        When cantools is not installed, or a frame has no room for the record.
    """
    need_cantools()
    if len(record.transducers) > MOST_FRAMES * MEASURED_ROOM:
        raise RigError(
            f"this rig's record has {len(record.transducers)} transducers, the CAN frames have room for "
            f"{MOST_FRAMES * MEASURED_ROOM}; bring the controller over UDP or as a ROS 2 node"
        )
    from cantools.database.can import Database, Node

    controller = [message for extended in (False, True) for message in _controller_messages(record, extended)]
    database = Database(
        messages=[*_rig_messages(record), *controller, *_j1939_messages()],
        version="1",
        nodes=[Node(RIG, "The virtual test rig"), Node(CONTROLLER, "Your shift controller")],
        dbc_specifics=_specifics({"ProtocolType": "J1939"}),
    )
    database.refresh()
    return database


def dbc_text(record: ControllerRecord) -> str:
    """Return the database as the text of a DBC file."""
    return database(record).as_dbc_string()


def _definitions() -> dict:
    """Return the attributes of J1939 databases, with the names that the tools of Vector and others read."""
    from cantools.database.can.formats.dbc import DbcAttributeDefinition as Definition

    kinds = ["StandardCAN", "ExtendedCAN", "reserved", "J1939PG"]
    found = [
        Definition("ProtocolType", "", None, "STRING"),
        Definition("VFrameFormat", "StandardCAN", "BO_", "ENUM", choices=kinds),
        Definition("PGN", 0, "BO_", "INT", 0, 0x3FFFF),
        Definition("SPN", 0, "SG_", "INT", 0, 0x7FFFF),
        Definition("GenMsgCycleTime", 0, "BO_", "INT", 0, 0xFFFF),
    ]
    return {definition.name: definition for definition in found}


def _specifics(attributes: dict) -> DbcSpecifics:
    """Return values of attributes in cantools' form."""
    from collections import OrderedDict

    from cantools.database.can.formats.dbc import DbcAttribute, DbcSpecifics

    known = _definitions()
    values = OrderedDict((name, DbcAttribute(value, known[name])) for name, value in attributes.items())
    return DbcSpecifics(attributes=values, attribute_definitions=OrderedDict(known))


def _signal(
    name: str,
    start: int,
    length: int,
    text: str,
    scale: float = 1,
    offset: float = 0,
    limits: tuple[float | None, float | None] = (None, None),
    choices: dict | None = None,
    **about: Any,
) -> Signal:
    """Return a signal; ``about`` is what else cantools takes: unit, spn, is_signed."""
    from collections import OrderedDict

    from cantools.database.can import Signal
    from cantools.database.conversion import BaseConversion

    conversion = BaseConversion.factory(scale, offset, OrderedDict(choices) if choices else None)
    low, high = limits
    return Signal(name, start, length, conversion=conversion, minimum=low, maximum=high, comment=text, **about)


def _wire(wire: Wire, start: int) -> Signal:
    return _signal(wire.name, start, 16, wire.text, wire.step, limits=wire.range, unit=wire.unit, is_signed=wire.raw[0] < 0)


def _message(name: str, sender: str, signals: list, text: str, group: bool = False, address: int = ADDRESS) -> Message:
    from cantools.database.can import Message

    number, more = FRAME_IDS.get(name), {}
    if group:
        number = j1939.identifier(GROUPS[name], address, priority=PRIORITIES[name])
        more = {"protocol": "j1939", "unused_bit_pattern": 0xFF, "dbc_specifics": _specifics({"PGN": GROUPS[name]})}
    shown = name + AS_GROUP if group and name in FRAME_IDS else name
    return Message(
        number, shown, 8, signals, comment=text, senders=[sender], cycle_time=CYCLES[name], is_extended_frame=group, **more
    )


def _rig_messages(record: ControllerRecord) -> list:
    sample = _signal("sample", 0, 16, "Controller sample, low 16 bits; the controller sends it back.")
    return [
        _message(
            REQUEST,
            RIG,
            [
                _signal(
                    "gear_request",
                    0,
                    8,
                    "Gear ordered last; stays until the next order, or a trip, then 0.",
                    choices=record.gear_names,
                ),
                _signal("level", 8, 8, "Level of this run: which of the two commands is used.", choices={0: "duty", 1: "current"}),
            ],
            "Every 10 ms and when the order changes.",
        ),
        *(
            _message(name, RIG, [_wire(wire, 16 * k) for k, wire in enumerate(wires)], "What the controller's transducers show.")
            for name, wires in reversed(split(MEASURED, measured(record)))
        ),
        *(
            _message(
                name,
                RIG,
                [sample, *(_wire(wire, 16 * k) for k, wire in enumerate(wires, 1))],
                "Coil currents; the last message of a sample." if name == CURRENTS else f"Coil currents; before {CURRENTS}.",
            )
            for name, wires in reversed(split(CURRENTS, currents(record)))
        ),
    ]


def _controller_messages(record: ControllerRecord, group: bool) -> list:
    """Return the controller's messages, as plain frames or as J1939 groups with any source address."""
    echo = "Sample that is answered, low 16 bits."
    state = _message(
        STATE,
        CONTROLLER,
        [
            _signal("sample", 0, 16, echo),
            _signal("gear", 16, 8, "Gear taken last.", choices=record.gear_names),
            _signal("shifting", 24, 8, "1: a shift is still running."),
            _signal("flags", 32, 8, "Bit k: at level current, output k stays on at a setpoint of zero."),
            _signal("status", 40, 8, "0: an answer, 2: error, 3: fatal; the rig trips with the last two."),
        ],
        "Before the command that it belongs to.",
        group,
        j1939.NULL,
    )
    out = [state]
    for last, level in ((COMMAND_CURRENT, "current"), (COMMAND_DUTY, "duty")):
        out += [
            _message(
                name,
                CONTROLLER,
                [_signal("sample", 0, 16, echo), *(_wire(wire, 16 * k) for k, wire in enumerate(wires, 1))],
                f"Completes an answer at level {level}." if name == last else f"Between {STATE} and {last}.",
                group,
                j1939.NULL,
            )
            for name, wires in reversed(split(last, commands(record, level)))
        ]
    return out


def _j1939_messages() -> list:
    """Return the rig's groups: ETC1 and ETC2 with the signals that it has, scaled as in J1939-71, and those of its address."""
    bits = {0: "off", 1: "on", 2: "error", 3: "not available"}
    return [
        _message(
            ETC1,
            RIG,
            [
                _signal("TransDrivelineEngaged", 0, 2, "A clutch holds: pressed and without slip.", choices=bits, spn=560),
                _signal("TransShiftInProcess", 4, 2, "A shift is running, as the controller reports it.", choices=bits, spn=574),
                _signal(
                    "TransOutputShaftSpeed",
                    8,
                    16,
                    "Speed of the output shaft wk.",
                    0.125,
                    0,
                    unit="rpm",
                    limits=(0, 8031.875),
                    spn=191,
                ),
                _signal(
                    "PercentClutchSlip",
                    24,
                    8,
                    "Slip of the clutch of the gear that the controller has taken.",
                    0.4,
                    0,
                    unit="%",
                    limits=(0, 100),
                    spn=522,
                ),
                _signal(
                    "TransInputShaftSpeed",
                    40,
                    16,
                    "Speed of the input shaft w0.",
                    0.125,
                    0,
                    unit="rpm",
                    limits=(0, 8031.875),
                    spn=161,
                ),
            ],
            "J1939 Electronic Transmission Controller 1, PGN 61442.",
            True,
        ),
        _message(
            ETC2,
            RIG,
            [
                _signal("TransSelectedGear", 0, 8, "Gear ordered last.", 1, -125, limits=(-125, 125), spn=524),
                _signal("TransActualGearRatio", 8, 16, "Input speed over output speed.", 0.001, 0, limits=(0, 64.255), spn=526),
                _signal(
                    "TransCurrentGear",
                    24,
                    8,
                    "Gear that the clutches hold; through a shift the one engaged last.",
                    1,
                    -125,
                    limits=(-125, 125),
                    spn=523,
                ),
            ],
            "J1939 Electronic Transmission Controller 2, PGN 61445.",
            True,
        ),
        *_address_messages(),
    ]


def _address_messages() -> list:
    """Return the groups of J1939-81 and -21 that the rig sends: its NAME, and the answer to a request that it cannot serve."""
    name = (
        ("IdentityNumber", 0, 21, "Random in each run.", 2837),
        ("ManufacturerCode", 21, 11, "0.", 2838),
        ("ECUInstance", 32, 3, "0.", 2840),
        ("FunctionInstance", 35, 5, "0.", 2839),
        ("Function", 40, 8, "3: transmission.", 2841),
        ("VehicleSystem", 49, 7, "0.", 2842),
        ("VehicleSystemInstance", 56, 4, "0.", 2843),
        ("IndustryGroup", 60, 3, "0: all.", 2846),
        ("ArbitraryAddressCapable", 63, 1, "0: the address stays.", 2844),
    )
    answer = (
        ("ControlByte", 0, 8, "1: the group is not available here."),
        ("AddressAcknowledged", 32, 8, "Address of the node that has asked."),
        ("PGNRequested", 40, 24, "The group that was requested."),
    )
    return [
        _message(
            CLAIM,
            RIG,
            [_signal(one, start, length, text, spn=spn) for one, start, length, text, spn in name],
            "J1939 address claimed with the NAME of the rig, PGN 60928.",
            True,
        ),
        _message(
            ACKNOWLEDGE,
            RIG,
            [_signal(one, start, length, text) for one, start, length, text in answer],
            "J1939 acknowledgement, PGN 59392.",
            True,
        ),
    ]
