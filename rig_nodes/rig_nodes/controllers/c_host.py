"""The process in which a C library runs, so that nothing in it can harm the rig; and the structs of rig_controller.h.

Started by c_library.py as a program of its own that imports nothing of the rig: it is there in 30 ms. Whole messages
over one socket: a description of the library, an order to create, then for each sample the inputs and the answer as
the structs' own bytes, and behind them what the library asked for and what it names its own. It ends when the socket
does, and is killed by the system when the rig's process has gone.
"""

import ctypes as ct
import json
import os
import signal
import socket
import sys

OUTPUTS, TEXT, OK = 3, 128, 0
FUNCTIONS = ("rig_controller_abi", "rig_controller_create", "rig_controller_step", "rig_controller_destroy")
# optional, both of a pair or none: function that names, function that brings or takes the values
PAIRS = {"wants": ("rig_controller_wants", "rig_controller_wanted"),
         "signals": ("rig_controller_signals", "rig_controller_signal_values"),
         "settings": ("rig_controller_settings", "rig_controller_set")}
END = b"end"  # in place of a sample: destroy the controller
PR_SET_PDEATHSIG = 1
THREE = ct.c_double * OUTPUTS


class AbiInfo(ct.Structure):
    """rig_controller_abi_info"""

    _fields_ = [
        (name, ct.c_uint32)
        for name in ("abi", "levels", "info_size", "parameter_size", "inputs_size", "outputs_size")
    ]


class Parameter(ct.Structure):
    """rig_parameter"""

    _fields_ = [("name", ct.c_char_p), ("value", ct.c_double)]


class Info(ct.Structure):
    """rig_controller_info"""

    _fields_ = [
        ("size", ct.c_uint32),
        ("level", ct.c_uint32),
        ("period", ct.c_double),
        ("command_high", ct.c_double),
        ("parameters", ct.POINTER(Parameter)),
        ("parameter_count", ct.c_uint32),
        ("message", ct.c_char * TEXT),
    ]


class Inputs(ct.Structure):
    """rig_controller_inputs"""

    _fields_ = [
        ("size", ct.c_uint32),
        ("gear_request", ct.c_uint32),
        ("sample", ct.c_uint64),
        ("time", ct.c_double),
        ("current", THREE),
        ("n_wej", ct.c_double),
        ("n_wyj", ct.c_double),
        ("p1", ct.c_double),
        ("p2", ct.c_double),
    ]


class Outputs(ct.Structure):
    """rig_controller_outputs"""

    _fields_ = [
        ("size", ct.c_uint32),
        ("flags", ct.c_uint32),
        ("gear", ct.c_uint32),
        ("shifting", ct.c_uint32),
        ("command", THREE),
        ("setpoint", THREE),
        ("message", ct.c_char * TEXT),
    ]


class Answer(ct.Structure):
    """What goes back for a sample: what step returned, and its outputs."""

    _fields_ = [("status", ct.c_int64), ("outputs", Outputs)]


def describe(path: str) -> tuple[ct.CDLL | None, dict]:
    """(the library, what the rig checks of it); the library is None when it cannot be called."""
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
    found = {"abi": {name: getattr(pointer.contents, name) for name, _ in AbiInfo._fields_}}
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
            if name is None:
                break
            text = name.decode("utf-8", "replace")
            found[key].append([text, item.value] if key == "settings" else text)
        getattr(library, values).restype = None
        getattr(library, values).argtypes = [ct.c_void_p, ct.POINTER(ct.c_double), ct.c_uint32]
    return library, found


def create(library: ct.CDLL, order: dict) -> tuple[ct.c_void_p, dict]:
    """(the instance, status and message) for the level, period and parameters of the order."""
    given, instance = order["parameters"], ct.c_void_p()
    parameters = (Parameter * len(given))(*((key.encode(), value) for key, value in given.items()))
    info = Info(ct.sizeof(Info), order["level"], order["period"], order["command_high"], parameters, len(parameters))
    status = library.rig_controller_create(ct.byref(info), ct.byref(instance))
    return instance, {"status": status, "message": info.message.decode("utf-8", "replace")}


def serve(line: socket.socket, path: str) -> None:
    """Everything from the library's loading to its end."""
    library, description = describe(path)
    line.send(json.dumps(description).encode())
    order = line.recv(1 << 20)
    if library is None or not order:
        return
    instance, created = create(library, json.loads(order))
    line.send(json.dumps(created).encode())
    if created["status"] != OK:
        return
    wants, signals, settings = (len(description[key]) for key in ("wants", "signals", "settings"))
    bring, take, give = (getattr(library, PAIRS[key][1], None) for key in ("wants", "signals", "settings"))
    place = ct.sizeof(Inputs) + 8 * wants
    size, width = place + 8 * settings, ct.sizeof(Answer) + 8 * signals
    frame, reply = bytearray(size), bytearray(width)
    inputs, wanted = Inputs.from_buffer(frame), (ct.c_double * wants).from_buffer(frame, ct.sizeof(Inputs))
    given = (ct.c_double * settings).from_buffer(frame, place)
    answer, own = Answer.from_buffer(reply), (ct.c_double * signals).from_buffer(reply, ct.sizeof(Answer))
    step, arguments = library.rig_controller_step, (instance, ct.byref(inputs), ct.byref(answer.outputs))
    receive, send = line.recv_into, line.send
    while (count := receive(frame)) == size:
        if wants:
            bring(instance, wanted, wants)
        if settings:
            give(instance, given, settings)
        ct.memset(ct.byref(answer), 0, width)
        answer.outputs.size = ct.sizeof(Outputs)
        answer.status = step(*arguments)
        if signals and answer.status == OK:
            take(instance, own, signals)
        send(reply)
    if count:
        library.rig_controller_destroy(instance)


def main() -> None:
    """Arguments: the library, the socket's descriptor, the rig's process."""
    path, descriptor, parent = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    ct.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        return
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)  # a person's Ctrl-C is the rig's to obey: it ends this process in order
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    with socket.socket(fileno=descriptor) as line:
        try:
            serve(line, path)
        except (BrokenPipeError, ConnectionResetError):
            pass  # the rig has gone


if __name__ == "__main__":
    main()
