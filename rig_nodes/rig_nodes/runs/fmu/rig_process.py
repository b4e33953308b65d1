# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The process behind the rig as an FMU: it takes requests of c/rig_process.c, runs the same Rig as everywhere, and answers.

The FMU starts it with the number of its socket and the FMU's folder of resources; it ends when the socket is closed.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import struct
import sys
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from ...base import RigError, printable
from .rig_state import arrays_like, from_bytes, key_of, to_bytes

if TYPE_CHECKING:
    from ...rig import RigConfig
    from ..faults import Acting
    from ..rig import Rig
    from .rig_variables import Values

INITIALIZE, STEP, TERMINATE, RESET, SAVE, RESTORE = range(1, 7)
OK, WARNING, DISCARD, ERROR, FATAL = range(5)
HEAD = struct.Struct("<II")  # request: what, samples; answer: status, samples done; with a state: its bytes, which follow
PIECE = 32768  # bytes of a state in one message
TEXT = 1024  # bytes of each string and of the sentence, as in c/model.h


class Recording:
    """The bag of a run inside an FMU, as `rig simulate` writes it, and its report.

    Parameters
    ----------
    folder : Path
        An empty or new folder.
    rig : Rig
        The rig.
    config : RigConfig
        Its configuration.
    seed : int
        Seed of the run.

    Raises
    ------
    RigError
        When the folder is not empty.
    """

    def __init__(self, folder: Path, rig: Rig, config: RigConfig, seed: int) -> None:
        from ...bags import LIBRARY_OF_RUN, BagWriter
        from ..bag_outputs import BagOutputs
        from ..sequence import Sequence
        from ..simulation import run_record

        self.folder, self.rig = folder, rig
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise RigError(f"the parameter record names the folder {folder}, which is not empty; name a new one")
        self.record = run_record(config, Sequence("fmu", "driven through FMI", 0.0), seed)
        self._bag = BagWriter(folder, "fmu", topics=config.catalogue.all_topics, library=LIBRARY_OF_RUN)
        self._bag.__enter__()
        self.outputs = BagOutputs(self._bag, rig, self.record, commands=True)

    def due(self) -> None:
        """Take what is due now."""
        self.outputs.boundary()

    def _controller(self) -> dict:
        """Return the run's record of the shift controller, if the rig has one."""
        if not self.rig.shifts:
            return {}
        return {"controller": {"name": "alfa46" if self.rig.embedded else "importer", "level": self.rig.level}}

    def close(self) -> None:
        """End the bag and write report.json beside it."""
        from ...analysis import build_report, gather, write_report
        from ...base import TICK_SAMPLES
        from ..rig_base import RigStatus

        self.outputs.finish()
        tripped = self.rig.status == RigStatus.TRIPPED
        end = (
            {"state": "tripped", "reason": self.rig.reason, "trip": self.rig.tripped_by}
            if tripped
            else {"state": "ended", "reason": "the importer ended the run"}
        )
        self._bag.end(**end)
        self._bag.__exit__(None, None, None)
        run = {
            **self.record,
            "mode": "fmu",
            **self._controller(),
            "duration_s": self.rig.time,
            "lost": 0,
            "ticks": self.rig.sample // TICK_SAMPLES,
            "overruns": 0,
            "lateness_ms": None,
            "end": end,
        }
        write_report(self.folder, build_report(gather(self.folder, run), run))


class RigModel:
    """One instance of the FMU; ``values`` holds parameters and inputs, and the outputs after each call.

    Parameters
    ----------
    resources : Path
        The FMU's folder of resources.
    """

    def __init__(self, resources: Path) -> None:
        from ...rig import load_rig
        from .rig_variables import Values, rig_variables

        origin = json.loads((resources / "rig.json").read_text(encoding="utf-8"))
        self.config = load_rig(str(resources / origin["file"]) if "file" in origin else origin["rig"], origin["set"])
        self.values = Values(rig_variables(self.config))
        self.rig = self._recording = None
        self._given: dict[str, tuple] = {}

    def initialize(self) -> None:
        """Make a new rig with the present parameters; RigError when one is not right."""
        from ..rig import Rig
        from .rig_variables import CONTROLLERS, Reader, Tunables, with_parameters

        values = self.values
        controller = int(values["controller"]) if self.config.structure.shifts else 0
        if controller not in range(len(CONTROLLERS)):
            raise RigError(f"parameter controller is {controller}, expected 0 (embedded), 1 (duty) or 2 (current)")
        config = replace(with_parameters(self.config, values), name=self.config.name)
        if controller:
            self.rig = Rig(config, int(values["seed"]), "external", CONTROLLERS[controller])
        else:
            self.rig = Rig(config, int(values["seed"]))
        self._given, self._changed_config = {}, config
        self._faults_ordered = ""
        self._first, self._first_texts = values.numbers.copy(), list(values.texts)
        self._acted = self._first  # values that act on the rig
        self._tunables = Tunables(config, values)
        self._reader = Reader(self.rig, values)
        self._reader.read()

    def step(self, samples: int) -> int:
        """Advance the rig with the present inputs, at most to a trip.

        Parameters
        ----------
        samples : int
            Number of samples.

        Returns
        -------
        int
            Number of samples done.
        """
        from ...rig import CHANGED, CONTROLLER, CONTROLLER_EVENTS

        if self.rig.sample == 0 and self.values.text("record") and self._recording is None:
            self._recording = Recording(Path(self.values.text("record")), self.rig, self._changed_config, int(self.values["seed"]))
        self._give_setpoints()
        for setting, value in self._tunables.give(self.rig):
            if self._recording is not None:
                topic = CONTROLLER_EVENTS if setting.owner == CONTROLLER else "/rig/events"
                self._recording.outputs.event(topic, CHANGED, setting.sentence(value), value)
        self._order_faults()
        self._acted = self.values.numbers.copy()
        command = self._command() if self.rig.shifts and not self.rig.embedded else None
        first = self.rig.sample
        end = first + samples
        while self.rig.sample < end and not self.rig.reason:
            if command is None:
                self._order()
            elif self.rig.sample:
                # as in runs.simulation: the answer to sample s takes effect from s + 1 on
                self.rig.set_command(int(self.values["controller"]) - 1, self.rig.sample - 1, *command)
            part = 1
            if self._recording is not None:
                self._recording.due()
            elif command is None:
                part = self._until_shift_end(end - self.rig.sample)
            self.rig.advance_samples(part)
        self._reader.read()
        return self.rig.sample - first

    def _give_setpoints(self) -> None:
        """Set the setpoints of devices whose inputs have changed."""
        from .rig_variables import enable_of

        values = self.values
        for step, setpoint in ((step, one.setpoint) for step, one in self.rig.settings.steps.items()):
            given = values[setpoint.name], values[enable_of(setpoint)] != 0.0
            if self._given.get(step, (0.0, False)) == given:
                continue
            self.rig.set(step, *given)
            self._given[step] = given
            if self._recording is not None:
                self._recording.outputs.setpoint(setpoint.topic, *given)

    def _order_faults(self) -> None:
        """Order the faults of the input for them when its text has changed; an empty one orders none."""
        from ...rig import FAULTS_APART
        from .rig_variables import FAULT

        if self.rig.faults is None or (text := self.values.text(FAULT)) == self._faults_ordered:
            return
        for order in text.split(FAULTS_APART) if text else ():
            self.rig.order_fault(order)
        self._faults_ordered = text

    def _command(self) -> tuple:
        """Return (command, setpoint, gear, shifting, flags) of the importer's controller."""
        values = self.values
        asked = [values[f"command_{k}"] for k in range(1, len(self.rig.duty) + 1)]
        return (
            asked,
            asked if self.rig.level == "current" else [0.0] * len(asked),
            int(values["command_gear"]),
            values["command_shifting"] != 0.0,
            int(values["command_flags"]),
        )

    def _order(self) -> None:
        """Order the requested gear when no shift runs."""
        if not self.rig.shifts:
            return
        request = int(self.values["gear_request"])
        if request == self.rig.gear or self.rig.shifting:
            return
        self.rig.order_gear(request)
        if self._recording is not None:
            from ...rig import CONTROLLER_EVENTS, SHIFT_ORDERED

            gear = self.rig.config.transmission.names[request]
            self._recording.outputs.event(CONTROLLER_EVENTS, SHIFT_ORDERED, f"shift to {gear} ordered", request)

    def _until_shift_end(self, samples: int) -> int:
        """Return the number of samples, limited to the end of a running shift when another gear is requested."""
        if not self.rig.shifting or int(self.values["gear_request"]) == self.rig.gear:
            return samples
        return max(1, min(samples, self.rig.shift_end + 1 - self.rig.sample))

    @cached_property
    def _key(self) -> str:
        return key_of(self.config)

    def save(self) -> bytes:
        """Return the state as bytes, none before there is a rig; RigError while a bag is recorded."""
        if self.rig is None:
            return b""
        self._check_unrecorded()
        state = self.rig.snapshot()
        plain = {name: value for name, value in state.values.items() if name != "config"}
        head = {
            "values": plain,
            "to_come": state.to_come,
            "texts": self._first_texts,
            "faults": _plain(state.faults),
            "ordered": self._faults_ordered,
        }
        return to_bytes(self._key, head, [self._first, self._acted, *state.arrays])

    def restore(self, data: bytes) -> None:
        """Return to a state that an instance of the same FMU saved.

        Parameters
        ----------
        data : bytes
            A result of :meth:`save`.

        Raises
        ------
        RigError
            When the state is not of this FMU, or while a bag is recorded.
        """
        self._check_unrecorded()
        if not data:
            self.rig = None
            return
        head, rest = from_bytes(self._key, data)
        values, size = self.values, self.values.numbers.nbytes
        now = values.numbers.copy(), list(values.texts)
        # the rig is made as it was then and set as it was; so its settings are right, and its state follows
        values.numbers[:], acted = arrays_like([values.numbers, values.numbers], rest[: 2 * size])
        values.texts[:] = head["texts"]
        self.initialize()
        values.numbers[:] = acted
        self._tunables.give(self.rig)
        self._give_setpoints()
        self._acted = acted
        state = self.rig.snapshot()
        arrays = tuple(arrays_like(state.arrays, rest[2 * size :]))
        faults = _acting(head["faults"], self._changed_config)
        then = {"values": state.values | head["values"], "to_come": head["to_come"], "arrays": arrays, "faults": faults}
        self.rig.restore(replace(state, **then))
        self._faults_ordered = head["ordered"]
        values.numbers[:], values.texts[:] = now

    def _check_unrecorded(self) -> None:
        if self._recording is not None:
            raise RigError(
                "the state of a run that is recorded is neither saved nor brought back; leave the parameter record empty"
            )

    def terminate(self) -> None:
        """End the recording, if there is one."""
        recording, self._recording = self._recording, None
        if recording is not None:
            recording.due()
            recording.close()


def serve(link: socket.socket, resources: Path) -> None:
    """Answer requests until the importer has gone."""
    model = RigModel(resources)
    values = model.values
    size = HEAD.size + values.numbers.nbytes + TEXT * len(values.texts)
    link.send(_answer(values, OK, 0, ""))
    while request := link.recv(size + TEXT):
        if len(request) != size:
            print("rig: the FMU was made by another version of rig_nodes; export it again", file=sys.stderr)
            break
        what, samples = HEAD.unpack_from(request)
        _take(values, request)
        status, done, sentence, state = OK, 0, "", b""
        while what == RESTORE and len(state) < samples and (piece := link.recv(PIECE)):
            state += piece
        try:
            if what == INITIALIZE:
                model.initialize()
            elif what == STEP:
                done = model.step(samples)
                if model.rig.reason:
                    status, sentence = DISCARD, f"the rig tripped at {model.rig.time:.3f} s: {model.rig.reason}"
            elif what == TERMINATE:
                model.terminate()
            elif what == RESET:
                model.terminate()
                model.rig = None
            elif what == RESTORE:
                model.restore(state)
            elif what == SAVE:
                state = model.save()
                done = len(state)
        except RigError as error:
            status, sentence = ERROR, str(error)
        except OSError as error:  # the bag cannot be written
            status, sentence = ERROR, f"the rig's process: {error}"
        link.send(_answer(values, status, done, sentence))
        if what == SAVE:
            for first in range(0, done, PIECE):
                link.send(state[first : first + PIECE])
    model.terminate()


def _plain(faults: tuple[Acting, ...]) -> list[list]:
    """Return the orders of faults that are not over as JSON takes them."""
    return [[one.order.text, one.due, one.began, one.level, one.shifts, one.held] for one in faults]


def _acting(plain: list[list], config: RigConfig) -> tuple[Acting, ...]:
    """Return the orders of faults in the form of :func:`_plain` as a rig that is made with this configuration takes them."""
    from ...rig import read_fault
    from ..faults import Acting

    return tuple(Acting(read_fault(config, text, "fault"), *rest) for text, *rest in plain)


def _take(values: Values, request: bytes) -> None:
    import numpy as np

    values.numbers[:] = np.frombuffer(request, np.float64, len(values.numbers), HEAD.size)
    at = HEAD.size + values.numbers.nbytes
    for k in range(len(values.texts)):
        values.texts[k] = request[at : at + TEXT].split(b"\0", 1)[0].decode("utf-8", "replace")
        at += TEXT


def _answer(values: Values, status: int, done: int, sentence: str) -> bytes:
    texts = b"".join(_padded(text) for text in [*values.texts, sentence])
    return HEAD.pack(status, done) + values.numbers.tobytes() + texts


def _padded(text: str) -> bytes:
    return text.encode()[: TEXT - 1].decode(errors="ignore").encode().ljust(TEXT, b"\0")


def main() -> int:
    """Run the process and return its exit code; arguments: number of the socket, folder of resources."""
    number, resources = int(sys.argv[1]), Path(sys.argv[2])
    os.closerange(number + 1, 1024)  # descriptors that the importer left open
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the importer, which ends this process
    try:
        with socket.socket(fileno=number) as link:
            serve(link, resources)
    except RigError as error:
        print(f"rig: {printable(error)}", file=sys.stderr)
        return error.exit_code
    except (BrokenPipeError, ConnectionResetError):
        return 0  # the importer has gone during the answer
    return 0


if __name__ == "__main__":
    sys.exit(main())
