# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The host of a C library, so that nothing in it can harm the rig; and the structs of rig_controller.h.

guard.py loads it in the library's process; it imports nothing of the rig and is ready in 30 ms. Whole messages go over one
socket: a description of the library, an order to create, then for each sample the inputs and the answer as the bytes of the
structs, followed by the transducers that the library wants and by its own signals. Behind SAID comes a sentence in place of an
answer: the library wrote outside the memory that it was given.
"""

from __future__ import annotations

import ctypes as ct
import json
import mmap
import os
import socket

ABI, TEXT, OK = 2, 128, 0
FUNCTIONS = ("rig_controller_abi", "rig_controller_create", "rig_controller_step", "rig_controller_destroy")
# optional pairs (both or none): the function that lists the names, and the one that receives or returns the values
PAIRS = {
    "wants": ("rig_controller_wants", "rig_controller_wanted"),
    "signals": ("rig_controller_signals", "rig_controller_signal_values"),
    "settings": ("rig_controller_settings", "rig_controller_set"),
}
STATE = ("rig_controller_save", "rig_controller_load")  # optional, both or none; only an FMU of the code calls them
DONE, SAID = b"done ", b"said "  # as in hosted.py
GUARD = bytes([0xA5]) * 4096  # before, between and behind what a library is given; no code may write there
# names of what a library is given, for people
INFO, PARAMETERS = "info of rig_controller_create", "parameters of rig_controller_create"
IN, OUT = "in of rig_controller_step", "out of rig_controller_step"
CURRENT, MEASURED = "current of rig_controller_step", "measured of rig_controller_step"
COMMAND, SETPOINT = "command of rig_controller_step", "setpoint of rig_controller_step"
WANTED, SET, VALUES = (f"values of {PAIRS[key][1]}" for key in ("wants", "settings", "signals"))
MOST, LONGEST = 64, 200  # names of each kind that a library can have (more are refused), bytes of a name
NUMBERS = ct.POINTER(ct.c_double)
GIVEN = 24  # bytes of rig_controller_inputs before its pointers; they come with each sample
POINTERS = slice(16, 32)  # the pointers' bytes in rig_controller_outputs


class AbiInfo(ct.Structure):
    """The struct rig_controller_abi_info."""

    _fields_ = [
        *((name, ct.c_uint32) for name in ("abi", "levels", "info_size", "parameter_size", "inputs_size", "outputs_size")),
        ("record", ct.c_char_p),  # not before ABI 2
    ]


class Parameter(ct.Structure):
    """The struct rig_parameter."""

    _fields_ = [("name", ct.c_char_p), ("value", ct.c_double)]


class Transducer(ct.Structure):
    """The struct rig_transducer."""

    _fields_ = [("name", ct.c_char_p), ("unit", ct.c_char_p)]


class Gear(ct.Structure):
    """The struct rig_gear."""

    _fields_ = [("number", ct.c_uint32), ("name", ct.c_char_p)]


class Info(ct.Structure):
    """The struct rig_controller_info."""

    _fields_ = [
        ("size", ct.c_uint32),
        ("level", ct.c_uint32),
        ("period", ct.c_double),
        ("command_high", ct.c_double),
        ("parameters", ct.POINTER(Parameter)),
        ("parameter_count", ct.c_uint32),
        ("message", ct.c_char * TEXT),
        ("record", ct.c_char_p),
        ("outputs", ct.POINTER(ct.c_char_p)),
        ("transducers", ct.POINTER(Transducer)),
        ("gears", ct.POINTER(Gear)),
        ("output_count", ct.c_uint32),
        ("transducer_count", ct.c_uint32),
        ("gear_count", ct.c_uint32),
    ]


class Inputs(ct.Structure):
    """The struct rig_controller_inputs."""

    _fields_ = [
        ("size", ct.c_uint32),
        ("gear_request", ct.c_uint32),
        ("sample", ct.c_uint64),
        ("time", ct.c_double),
        ("current", NUMBERS),
        ("measured", NUMBERS),
    ]


class Outputs(ct.Structure):
    """The struct rig_controller_outputs."""

    _fields_ = [
        ("size", ct.c_uint32),
        ("flags", ct.c_uint32),
        ("gear", ct.c_uint32),
        ("shifting", ct.c_uint32),
        ("command", NUMBERS),
        ("setpoint", NUMBERS),
        ("message", ct.c_char * TEXT),
    ]


class Guarded:
    """Memory for structs and arrays that a library is given, with a GUARD before and behind each.

    Parameters
    ----------
    parts : dict of str to int
        Size of each part in bytes, a multiple of 8, by its name; a part of 0 bytes gets an empty view and no guard.
    """

    def __init__(self, parts: dict[str, int]) -> None:
        self._names, self._guards, place = [name for name, size in parts.items() if size], [0], len(GUARD)
        self._memory = mmap.mmap(-1, sum(parts.values()) + len(GUARD) * (len(self._names) + 1))
        view = memoryview(self._memory)
        self.views: dict[str, memoryview] = {}
        for name, size in parts.items():
            self.views[name] = view[place : place + size]
            if size:
                self._guards.append(place + size)
                place += size + len(GUARD)
        for first in self._guards:
            self._memory[first : first + len(GUARD)] = GUARD
        self._spans = [slice(first, first + len(GUARD)) for first in self._guards]

    def damage(self) -> str:
        """Return a sentence on what was written into the guards; empty when nothing was."""
        memory = self._memory
        for number, span in enumerate(self._spans):  # noqa: B007, it names the guard behind the loop
            if memory[span] != GUARD:
                break
        else:
            return ""
        changed = [place for place, byte in enumerate(memory[span]) if byte != GUARD[0]]
        size, count = len(GUARD), len(changed)
        behind = f"behind {self._names[number - 1]}" if number else ""
        before = f"before {self._names[number]}" if number < len(self._names) else ""
        where = behind if behind and (not before or changed[0] < size - 1 - changed[-1]) else before
        far = changed[0] if where is behind else size - 1 - changed[-1]
        away = f", {far} bytes away from it" if far else ""
        return f"the library wrote {count} byte{'s' * (count > 1)} {where}{away}; that memory is not its own"


def describe(path: str) -> tuple[ct.CDLL | None, dict]:
    """Load a library and describe it.

    Parameters
    ----------
    path : str
        The library's file.

    Returns
    -------
    tuple
        (library, description): the library is None when it cannot be called; the description is a dict for the rig to check.
    """
    try:
        library = ct.CDLL(path)
    except OSError as error:
        return None, {"error": str(error)}
    missing = [function for function in FUNCTIONS if not hasattr(library, function)]
    if missing:
        return None, {"missing": missing}
    library.rig_controller_abi.restype = ct.POINTER(AbiInfo)
    library.rig_controller_abi.argtypes = []
    library.rig_controller_create.argtypes = [ct.POINTER(Info), ct.POINTER(ct.c_void_p)]
    library.rig_controller_step.argtypes = [ct.c_void_p, ct.POINTER(Inputs), ct.POINTER(Outputs)]
    library.rig_controller_destroy.restype = None
    library.rig_controller_destroy.argtypes = [ct.c_void_p]
    pointer = library.rig_controller_abi()
    if not pointer:
        return None, {"abi": None}
    info = pointer.contents
    found: dict = {"abi": {field[0]: getattr(info, field[0]) for field in AbiInfo._fields_ if field[1] is ct.c_uint32}}
    if info.abi != ABI:
        return None, found
    found["abi"]["record"] = (info.record or b"").decode("utf-8", "replace")
    for key, (names, values) in PAIRS.items():
        found[key] = []
        if not hasattr(library, names):
            continue
        if not hasattr(library, values):
            return None, {"missing": [values]}
        function = getattr(library, names)
        function.restype, function.argtypes = ct.POINTER(Parameter if key == "settings" else ct.c_char_p), []
        given = function()
        while given:
            item = given[len(found[key])]
            name = item.name if key == "settings" else item
            if name is None or len(found[key]) > MOST:
                break
            text = name[:LONGEST].decode("utf-8", "replace")
            found[key].append([text, item.value] if key == "settings" else text)
        getattr(library, values).restype = None
        getattr(library, values).argtypes = [ct.c_void_p, ct.POINTER(ct.c_double), ct.c_uint32]
    lacking = [name for name in STATE if not hasattr(library, name)]
    if len(lacking) == 1:
        return None, {"missing": lacking}
    found["saves"] = not lacking
    return library, found


def create(library: ct.CDLL, order: dict) -> tuple[ct.c_void_p, dict]:
    """Create the controller.

    Parameters
    ----------
    library : ctypes.CDLL
        The library.
    order : dict
        Level, period, parameters and record, as the rig sends them.

    Returns
    -------
    tuple
        (instance, result): a pointer, and a dict with status, message and damage.
    """
    given, instance = order["parameters"], ct.c_void_p()
    memory = Guarded({INFO: ct.sizeof(Info), PARAMETERS: ct.sizeof(Parameter) * len(given)})
    parameters = (Parameter * len(given)).from_buffer(memory.views[PARAMETERS])
    for place, (key, value) in zip(parameters, given.items(), strict=True):
        place.name, place.value = key.encode(), value
    info = Info.from_buffer(memory.views[INFO])
    info.size, info.level, info.period = ct.sizeof(Info), order["level"], order["period"]
    info.command_high, info.parameters, info.parameter_count = order["command_high"], parameters, len(parameters)
    outputs, transducers, gears = order["outputs"], order["transducers"], order["gears"]
    info.record = order["record"].encode()
    info.outputs = (ct.c_char_p * len(outputs))(*map(str.encode, outputs))
    info.transducers = (Transducer * len(transducers))(*((name.encode(), unit.encode()) for name, unit in transducers))
    info.gears = (Gear * len(gears))(*((number, name.encode()) for number, name in gears))
    info.output_count, info.transducer_count, info.gear_count = len(outputs), len(transducers), len(gears)
    status = library.rig_controller_create(ct.byref(info), ct.byref(instance))
    return instance, {"status": status, "message": info.message.decode("utf-8", "replace"), "damage": memory.damage()}


def _absent(*_: object) -> None:
    """Stand for a function that the library need not have; it is not called, as there is nothing to bring, take or give."""


def serve(line: socket.socket, path: str) -> None:
    """Do everything from the library's loading to its end; OSError when the line to the rig is lost."""
    this = os.getpid()
    library, description = describe(path)
    line.send(json.dumps({**description, "process": os.getpid()}).encode())
    order = line.recv(1 << 20)
    if library is None or not order:
        return
    order = json.loads(order)
    instance, created = create(library, order)
    line.send(json.dumps(created).encode())
    if created["status"] != OK or created["damage"]:
        return
    wants, signals, settings = (len(description[key]) for key in ("wants", "signals", "settings"))
    bring, take, give = (getattr(library, PAIRS[key][1], _absent) for key in ("wants", "signals", "settings"))
    outputs_8, transducers_8 = 8 * len(order["outputs"]), 8 * len(order["transducers"])
    memory = Guarded(
        {
            IN: ct.sizeof(Inputs),
            CURRENT: outputs_8,
            MEASURED: transducers_8,
            WANTED: 8 * wants,
            SET: 8 * settings,
            OUT: ct.sizeof(Outputs),
            COMMAND: outputs_8,
            SETPOINT: outputs_8,
            VALUES: 8 * signals,
        }
    )
    views, answered, status, damage = memory.views, ct.c_uint64(), ct.c_int64(), memory.damage
    frame = [views[IN][:GIVEN], *(views[name] for name in (CURRENT, MEASURED, WANTED, SET) if views[name])]
    size = sum(map(len, frame))
    inputs, outputs = Inputs.from_buffer(views[IN]), Outputs.from_buffer(views[OUT])
    for place, name, view in (
        (inputs, "current", CURRENT),
        (inputs, "measured", MEASURED),
        (outputs, "command", COMMAND),
        (outputs, "setpoint", SETPOINT),
    ):
        if views[view]:
            setattr(place, name, ct.cast((ct.c_double * (len(views[view]) // 8)).from_buffer(views[view]), NUMBERS))
    outputs.size = ct.sizeof(Outputs)
    out, command, setpoint = views[OUT], views[COMMAND], views[SETPOINT]
    nothing, zeros, pointers, kept = bytes(out), bytes(outputs_8), bytes(out[POINTERS]), out[POINTERS]
    wanted, given, own = (
        (ct.c_double * count).from_buffer(views[name]) for name, count in ((WANTED, wants), (SET, settings), (VALUES, signals))
    )
    reply = [answered, status, out, command, setpoint, *([own] if signals else [])]
    step, arguments = library.rig_controller_step, (instance, ct.byref(inputs), ct.byref(outputs))
    receive, send = line.recvmsg_into, line.sendmsg
    while (count := receive(frame)[0]) == size:
        if wants:
            bring(instance, wanted, wants)
        if settings:
            give(instance, given, settings)
        out[:], command[:], setpoint[:] = nothing, zeros, zeros
        answered.value = inputs.sample
        status.value = step(*arguments)
        if signals:
            ct.memset(ct.byref(own), 0, ct.sizeof(own))
            if status.value == OK:
                take(instance, own, signals)
        if os.getpid() != this:
            os._exit(0)  # a copy that the library has forked; the library itself answers
        text = damage()
        if not text and kept != pointers:
            text = "the library moved command or setpoint to an array of its own; the numbers go where they point"
        if text:
            line.send(SAID + text.encode())
            return
        send(reply)
    if not count:
        raise OSError("the line to the rig is closed")
    library.rig_controller_destroy(instance)
    line.send(DONE)
