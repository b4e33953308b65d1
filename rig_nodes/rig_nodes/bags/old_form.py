# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conversion of older bags' topics, messages and records to today's form, so that readers handle one name and one form of each.

bags.records uses it to read a file's channels, rig_record to read a rig's record. In the older form messages began with a bare
stamp, controller messages had one rig's numbers as fields, the gearbox's state had one laboratory's symbols, controller topics
were named after one controller, and a record held only values: the structures of two kinds of rigs were fixed.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping
from copy import deepcopy

from .definitions import installed, message_file

TOPICS = {f"/alfa46/{name}": f"/controller/{name}" for name in ("command", "events", "signals", "channels")}
_STAMP = re.compile(r"^builtin_interfaces/Time stamp\b.*$", re.M)
_HEADER = "std_msgs/Header header"
_SEPARATOR = "=" * 80
_FRAME = b"\x01\x00\x00\x00\x00\x00\x00\x00"  # an empty frame_id, and the gap behind it

Convert = Callable[[bytes], bytes]


def topic_of_today(name: str) -> str:
    """Return the name that a topic has today."""
    return TOPICS.get(name, name)


def form_of_today(ros_type: str, text: str) -> tuple[str, Convert | None]:
    """Return a rig message type's definition in today's form, and the function that converts its messages to that form.

    Parameters
    ----------
    ros_type : str
        Message type.
    text : str
        The definition that the bag holds.

    Returns
    -------
    text : str
        The definition in today's form.
    convert : callable or None
        Converts the bytes of a message; None when nothing has to be converted.
    """
    if not ros_type.startswith("rig_msgs/"):
        return text, None
    for old, new in _RENAMED.get(ros_type, {}).items():
        text = re.sub(rf"^(float64 ){old}\b", rf"\1{new}", text, flags=re.M)
    own, separator, others = text.partition(_SEPARATOR)
    if not _STAMP.search(own):
        return text, None
    fields = {line.split("#")[0].strip() for line in own.splitlines()}
    for (known, mark), convert in _SHAPES.items():
        if ros_type == known and mark in fields:
            return installed(ros_type).text, convert
    return f"{_STAMP.sub(_HEADER, own)}{_header_text()}{separator}{others}", _with_header


def _with_header(data: bytes) -> bytes:
    """Put a Header in place of a stamp: everything behind it moves by 8 bytes, which keeps every number aligned."""
    return data[:12] + _FRAME + data[12:]


def _sample(data: bytes) -> bytes:
    """Convert a ControllerSample with three currents and four fields; bytes that are too short stay as they are."""
    if len(data) < 84:
        return data
    return b"".join((data[:12], _FRAME, data[12:28], struct.pack("<I4x", 3), data[28:52], struct.pack("<I4x", 4), data[52:84]))


def _command(data: bytes) -> bytes:
    """Convert a ValveCommand with three duties and setpoints before its small numbers; too short bytes stay as they are."""
    if len(data) < 80:
        return data
    return b"".join(
        (data[:12], _FRAME, data[12:28], data[76:80], struct.pack("<I", 3), data[28:52], struct.pack("<I4x", 3), data[52:76])
    )


# fields that have another name today: the laboratory's symbols stood in a message of every rig
_RENAMED = {"rig_msgs/msg/GearboxState": {"w_wej": "speed_in", "w_wyj": "speed_out", "m_wej": "torque_in", "m_wyj": "torque_out"}}
# messages whose fields differ today: (type, a field of the older form) -> conversion
_SHAPES = {("rig_msgs/msg/ControllerSample", "float64 n_wej"): _sample, ("rig_msgs/msg/ValveCommand", "float64[3] duty"): _command}


# the rig whose input shaft is rigid as in older records of the gearbox, what they take from it, and what they do not have
_RIGID = "chapter9", ("structure", "w0", "M_wej"), ("rotor", "input_shaft")
# older records: kind -> (installed rig, moved values: old section and value -> today's section and value, renamed sections)
_GEARBOX_MOVED = {
    ("gearbox", "inertia_in"): ("w0", "inertia"),
    ("gearbox", "inertia_in_gearbox"): ("M_wej", "inertia"),
    ("gearbox", "inertia_out_z5"): ("z5", "inertia"),
    ("gearbox", "inertia_pump"): ("M_wyj", "inertia"),
    ("gearbox", "loss_in_speed"): ("loss_in", "by_speed"),
    ("gearbox", "loss_in_at_rest"): ("loss_in", "at_rest"),
    ("gearbox", "loss_in_at_470"): ("loss_in", "at_470"),
    ("gearbox", "loss_in_constant"): ("loss_in", "constant"),
    ("gearbox", "loss_in_share"): ("loss_in", "share"),
    ("gearbox", "loss_in_square"): ("loss_in", "square"),
    ("gearbox", "loss_out_constant"): ("loss_out", "drag"),
    ("gearbox", "loss_out_share"): ("loss_out", "share"),
    ("gearbox", "loss_out_square"): ("loss_out", "square"),
    ("gearbox", "loss_by_load_side"): ("loss_out", "torque_side"),
}
_BENCH_MOVED = {
    ("hydraulic_motor", "inertia"): ("motor", "inertia"),
    ("shaft", "meter_stiffness"): ("torque_meter", "stiffness"),
    ("shaft", "meter_damping"): ("torque_meter", "damping"),
}
_RECORDS = {"gearbox": ("hydmag", _GEARBOX_MOVED, {}), "clutch_bench": ("clutch_bench", _BENCH_MOVED, {"pack": "clutch_pack"})}


def record_of_today(record: Mapping) -> Mapping:
    """Return a rig's record as RigConfig.as_dict makes it today; a record that is not of an older form is returned unchanged.

    The structure, and the values that older records did not have, are those of the installed rig; the input shaft of an older
    gearbox is rigid.

    Parameters
    ----------
    record : mapping
        The record of a bag or a report.

    Returns
    -------
    mapping
        The record in today's form.

    Raises
    ------
    TypeError
        When a part of the record is not a map.
    """
    kind = record.get("kind") or ("gearbox" if "gearbox" in record else None)
    if "structure" in record or kind not in _RECORDS:
        return record
    from ..rig import load_rig  # imported here, because the modules that read a rig depend on bags

    rig, moved, renamed = _RECORDS[kind]
    out = deepcopy(load_rig(rig).as_dict())
    if kind == "gearbox":
        stiff, taken, left_out = _RIGID
        out = {name: values for name, values in out.items() if name not in left_out}
        out |= {name: deepcopy(load_rig(stiff).as_dict()[name]) for name in taken}
    for then, values in record.items():
        name = renamed.get(then, then)
        if isinstance(values, Mapping):
            kept = {key: value for key, value in values.items() if (then, key) not in moved}
            if then != "gearbox":
                out[name] = {**out.get(name, {}), **kept}
        elif name in ("name", "wiring"):
            out[name] = values
        elif name in out:
            raise TypeError(f"{then} is no map of values")
    for (then, key), (name, value) in moved.items():
        if key in record.get(then, {}):
            out[name][value] = record[then][key]
    return out


def _header_text() -> str:
    """Return the definition of Header that follows a definition with a Header; it brings its own Time when the bag has none."""
    path = message_file("std_msgs/msg/Header")
    return f"{_SEPARATOR}\nMSG: std_msgs/Header\n{path.read_text(encoding='utf-8').rstrip()}\n"
