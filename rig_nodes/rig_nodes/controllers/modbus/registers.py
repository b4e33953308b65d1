# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Modbus register map of a rig's record; the rig is the server.

It is used by the plug (modbus.py), by `rig export registers` and by the example client.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass

from ...base import RigError
from ..record import ControllerRecord
from ..wire import Wire, commands, given


@dataclass(frozen=True)
class Register:
    """One 16-bit holding register; ``step`` is the value of one count in ``unit``, None for plain numbers."""

    address: int
    name: str
    access: str
    unit: str
    step: float | None
    signed: bool
    text: str


COMMAND_BASE = 32
HEARTBEAT, STATE = 0, ("gear", "shifting", "flags", "status")  # from COMMAND_BASE on: heartbeat, commands, then this state


def register_map(record: ControllerRecord) -> list[Register]:
    """Return all registers, by address.

    Parameters
    ----------
    record : ControllerRecord
        The rig's record.

    Returns
    -------
    list of Register
        The registers that the controller reads, then those that it writes.

    Raises
    ------
    RigError
        When the record has more numbers than there are registers to read.
    """
    out = [
        Register(0, "sample_high", "read", "", None, False, "Controller sample since time 0, upper 16 bits."),
        Register(1, "sample_low", "read", "", None, False, "Its lower 16 bits."),
        Register(2, "gear_request", "read", "", None, False, f"Gear ordered last: {record.gears_text}."),
        Register(3, "level", "read", "", None, False, "Level of this run: 0 duty, 1 current."),
    ]
    out += [_wired(len(out) + k, wire, "read") for k, wire in enumerate(given(record))]
    if len(out) > COMMAND_BASE:
        raise RigError(
            f"this rig's record takes {len(out)} registers to read, Modbus has {COMMAND_BASE} for them; bring the "
            "controller over UDP or as a ROS 2 node"
        )
    current, duty = commands(record, "current"), commands(record, "duty")
    out.append(
        Register(
            COMMAND_BASE,
            "heartbeat",
            "write",
            "",
            None,
            False,
            "Any other number than before: what is written with it is a new command.",
        )
    )
    for k, (one, other) in enumerate(zip(current, duty, strict=True), 1):
        out.append(
            Register(
                COMMAND_BASE + k,
                one.name,
                "write",
                f"{one.unit} or {other.unit}",
                one.step,
                False,
                f"{one.text} At level duty: {other.text.lower()} A count is {one.step:g} {one.unit} or "
                f"{other.step:g} {other.unit}.",
            )
        )
    texts = (
        "Gear taken last.",
        "1: a shift is still running.",
        "Bit k: at level current, output k stays on at a setpoint of zero.",
        "0: an answer, 2: error, 3: fatal; the rig trips with the last two.",
    )
    return out + [
        Register(COMMAND_BASE + 1 + len(current) + k, name, "write", "", None, False, text)
        for k, (name, text) in enumerate(zip(STATE, texts, strict=True))
    ]


def _wired(address: int, wire: Wire, access: str) -> Register:
    return Register(address, wire.name, access, wire.unit, wire.step, wire.raw[0] < 0, wire.text)


def csv_text(record: ControllerRecord) -> str:
    """Return the map as CSV with one head line."""
    file = io.StringIO()
    table = csv.writer(file, lineterminator="\n")
    table.writerow(("address", "name", "access", "type", "unit", "count", "meaning"))
    for row in register_map(record):
        table.writerow(
            (
                row.address,
                row.name,
                row.access,
                "int16" if row.signed else "uint16",
                row.unit,
                "1" if row.step is None else f"{row.step:g}",
                row.text,
            )
        )
    return file.getvalue()


def markdown_text(record: ControllerRecord) -> str:
    """Return the map as a table in markdown, as ``rig export registers -o FILE.md`` writes it."""
    rows = list(csv.reader(io.StringIO(csv_text(record))))
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join([lines[0], "|" + " --- |" * len(rows[0]), *lines[1:]]) + "\n"
