# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics, messages and records of older bags in today's form: whoever reads a bag knows one name and one form of each.

Used where a file's channels are read (mcap_file) and where a rig is taken from its record (rig_record). Before, messages
began with a bare stamp, the controller's had one rig's numbers as fields, its topics were named after one controller, and a
record held values alone: what the rig is made of was known of two kinds of rigs.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping
from copy import deepcopy
from pathlib import Path

from ament_index_python.packages import get_package_share_directory

from .definitions import installed

TOPICS = {f"/alfa46/{name}": f"/controller/{name}" for name in ("command", "events", "signals", "channels")}
_STAMP = re.compile(r"^builtin_interfaces/Time stamp\b.*$", re.M)
_HEADER = "std_msgs/Header header"
_SEPARATOR = "=" * 80
_FRAME = b"\x01\x00\x00\x00\x00\x00\x00\x00"  # an empty frame_id, and the gap behind it

Convert = Callable[[bytes], bytes]


def topic_of_today(name: str) -> str:
    """The name that a topic has today."""
    return TOPICS.get(name, name)


def form_of_today(ros_type: str, text: str) -> tuple[str, Convert | None]:
    """The definition of a type of the rig in today's form, and what brings its messages there; None for nothing.

    text: the definition that a bag holds.
    """
    own, separator, others = text.partition(_SEPARATOR)
    if not ros_type.startswith("rig_msgs/") or not _STAMP.search(own):
        return text, None
    fields = {line.split("#")[0].strip() for line in own.splitlines()}
    for (known, mark), convert in _SHAPES.items():
        if ros_type == known and mark in fields:
            return installed(ros_type).text, convert
    return f"{_STAMP.sub(_HEADER, own)}{_header_text()}{separator}{others}", _with_header


def _with_header(data: bytes) -> bytes:
    """A Header in place of a stamp: everything behind it moves by 8 bytes, which keeps every number aligned."""
    return data[:12] + _FRAME + data[12:]


def _sample(data: bytes) -> bytes:
    """ControllerSample with three currents and four fields; what is too short stays what it is."""
    if len(data) < 84:
        return data
    return b"".join((data[:12], _FRAME, data[12:28], struct.pack("<I4x", 3), data[28:52], struct.pack("<I4x", 4), data[52:84]))


def _command(data: bytes) -> bytes:
    """ValveCommand with three duties and setpoints before its small numbers; what is too short stays what it is."""
    if len(data) < 80:
        return data
    return b"".join(
        (data[:12], _FRAME, data[12:28], data[76:80], struct.pack("<I", 3), data[28:52], struct.pack("<I4x", 3), data[52:76])
    )


# messages whose fields are others today: type and a field of the older form
_SHAPES = {("rig_msgs/msg/ControllerSample", "float64 n_wej"): _sample, ("rig_msgs/msg/ValveCommand", "float64[3] duty"): _command}


# records of before: kind -> (the installed rig that it was, what moved: section and value then -> section and value today)
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
    """A rig's record as RigConfig.as_dict makes it today; as it is where it says nothing of a rig of before.

    Structure, and values that there were none of then, are those of the installed rig. Raises TypeError for a record whose
    parts are no maps.
    """
    kind = record.get("kind") or ("gearbox" if "gearbox" in record else None)
    if "structure" in record or kind not in _RECORDS:
        return record
    from ..testbench.configuration import load_rig  # here, as all that reads a rig stands above bags

    rig, moved, renamed = _RECORDS[kind]
    out = deepcopy(load_rig(rig).as_dict())
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
    """What stands behind a definition with a Header, which brings its Time itself where the bag has none."""
    path = Path(get_package_share_directory("std_msgs")) / "msg" / "Header.msg"
    return f"{_SEPARATOR}\nMSG: std_msgs/Header\n{path.read_text(encoding='utf-8').rstrip()}\n"
