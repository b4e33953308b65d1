"""The process in which a controller FMU runs: samples of the plug (fmu.py) in, answers out, until its link closes."""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
import threading
import time

from ..errors import RigError
from ..fmu.importer import Fmu, FmuFailed
from .fmu import ANSWER, FRAME, SAMPLE
from .seam import OUTPUTS, Status

NUMBERS = range(1, OUTPUTS + 1)
COMMANDS, SETPOINTS = [f"command_{k}" for k in NUMBERS], [f"setpoint_{k}" for k in NUMBERS]
INPUTS = ["gear_request", *(f"current_{k}" for k in NUMBERS), "n_wej", "n_wyj", "p1", "p2"]
OUTPUT_NAMES = [*COMMANDS, *SETPOINTS, "gear", "shifting", "flags", "status"]
LEVELS = ("duty", "current")
STATUS = {"discard": Status.DISCARD, "error": Status.ERROR, "fatal": Status.FATAL}


def check_variables(fmu: Fmu) -> list[str]:
    """The seam's inputs that the FMU has; RigError when a variable lacks or has the wrong causality."""
    there = fmu.variables
    for name in ("gear_request", "command_1", "command_2", "gear", "shifting"):
        if name not in there:
            raise RigError(f"the FMU has no variable {name}; it has {', '.join(there)}")
    for wanted, names in (("input", INPUTS), ("output", OUTPUT_NAMES)):
        for name in names:
            if name in there and there[name].causality != wanted:
                raise RigError(f"the FMU's variable {name} has causality {there[name].causality}, expected {wanted}")
    return [name for name in INPUTS if name in there]


def levels_of(fmu: Fmu) -> list[str]:
    """The levels that the FMU knows: by its parameter level, else by the unit of command_1, the likelier one first."""
    level = fmu.variables.get("level")
    if level is None:
        return ["current"] if fmu.variables["command_1"].unit in ("A", "mA") else ["duty", "current"]
    low, high = int(level.min or 0), int(level.max if level.max is not None else 1)
    preferred = int(float(level.start or 0))
    known = [name for k, name in enumerate(LEVELS) if low <= k <= high]
    return sorted(known, key=lambda name: LEVELS.index(name) != preferred)


def start_values(fmu: Fmu, level: str, parameters: dict[str, float]) -> dict[str, float]:
    """The rig's settings and the level, of those that the FMU has as parameters."""
    given = {**parameters, "level": LEVELS.index(level)}
    return {name: value for name, value in given.items()
            if name in fmu.variables and fmu.variables[name].causality == "parameter"}


def answer_samples(link: socket.socket, fmu: Fmu, period: float) -> None:
    """One communication step for each sample, until the link closes."""
    inputs = check_variables(fmu)
    write, places = fmu.writer(inputs), [INPUTS.index(name) for name in inputs]
    told = [name for name in OUTPUT_NAMES if name in fmu.variables]
    read, first, done = fmu.reader(told), None, 0
    while data := link.recv(FRAME):
        sample, request, *values = SAMPLE.unpack(data)
        given = [request, *values]
        first = sample if first is None else first
        fmu.said = ""
        try:
            write([given[k] for k in places])
            while done <= sample - first:  # samples that did not come are stepped over with what is known now
                fmu.step(done * period, period)
                done += 1
            found = dict(zip(told, read(), strict=True))
        except FmuFailed as failure:
            link.send(ANSWER.pack(STATUS.get(failure.status, Status.ERROR), 0, 0, 0, *[0.0] * 6) + str(failure).encode())
            continue
        command = [found.get(name, 0.0) for name in COMMANDS]
        setpoint = [found.get(name, 0.0) for name in SETPOINTS]
        gear, shifting, flags = (max(0, int(found.get(name, 0))) for name in ("gear", "shifting", "flags"))
        status = Status.DISCARD if found.get("status") == Status.DISCARD else Status.OK
        link.send(ANSWER.pack(status, gear, shifting, flags, *command, *setpoint))


def end_with(parent: int) -> None:
    """End this process when its parent has gone, even while the FMU computes without end."""
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)


def main() -> int:
    """Entry point: number of the socket, the FMU's file."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the rig decides
    threading.Thread(target=end_with, args=(os.getppid(),), daemon=True).start()
    with socket.socket(fileno=int(sys.argv[1])) as link:
        try:
            with Fmu(sys.argv[2], "controller") as fmu:
                check_variables(fmu)
                link.send(json.dumps({"levels": levels_of(fmu)}).encode())
                start = link.recv(FRAME)
                if not start:
                    return 0
                order = json.loads(start)
                fmu.initialize(**start_values(fmu, order["level"], order["parameters"]))
                link.send(b"{}")
                answer_samples(link, fmu, order["period"])
                fmu.terminate()
        except RigError as error:
            link.send(json.dumps({"error": str(error).removeprefix(f"{sys.argv[2]}: ")}).encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
