# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plug for a controller as an FMU (2.0 or 3.0 co-simulation): ``fmu:FILE.fmu``.

load.py makes it. The FMU runs in a process of its own (hosted.py, process.py), so that its crash is a fatal status and does not
end the rig.
"""

from __future__ import annotations

import json
import os
import struct
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from ...base import RigError, no_file
from ..hosted import Host, HostedPlug, Hosting
from ..own_signals import checked_settings, checked_signals
from ..plug import DECLARED, DEFAULT, chosen_level
from ..record import record_of
from ..seam import ControllerInputs, ControllerOutputs, Status, checked_wants

if TYPE_CHECKING:
    from ...rig import RigConfig

# behind a sample: wanted transducers, the FMU's settings; behind an answer: the FMU's signals, or for a status other
# than ok a sentence
SAMPLE = "<QI{}d"  # sample, gear_request, currents, transducers
ANSWER = "<Q4d{}d"  # sample; status, gear, shifting, flags as the FMU gives them; commands, setpoints
MESSAGE = 4096  # bytes of a message that are shown
FMU = Hosting(
    "the FMU", str(Path(__file__).parents[3]), "rig_nodes.controllers.fmi.process", "rig-fmu", ("terminate", "freeInstance")
)


class ControllerFmu(HostedPlug):
    """A controller FMU; its variables are found by the names of the seam (docs/how_to/fmu.md)."""

    def __init__(self, file: str, config: RigConfig, level: str | None = None) -> None:
        name = f"fmu:{file}"
        if not Path(file).is_file():
            raise RigError(f"controller {name}: {no_file(file)}")
        record = record_of(config)
        outputs, names = len(record.outputs), list(record.names)
        self._sample, self._answer_form = (
            struct.Struct(SAMPLE.format(outputs + len(names))),
            struct.Struct(ANSWER.format(2 * outputs)),
        )
        about = {
            "outputs": outputs,
            "transducers": names,
            "known": record.all_transducers,
            "record": record.number,
            "rig": record.rig,
            "valves": [k for k, output in enumerate(record.outputs, 1) if output.valve],
        }
        message_descriptor = os.memfd_create("message")
        self._message_file = open(message_descriptor, "rb", buffering=0)  # the FMU's newest message, which outlives its process
        folder = tempfile.mkdtemp(prefix="rig-fmu-")  # a crash must not leave the unpacked files behind
        arguments = [file, folder, str(message_descriptor), json.dumps(about)]
        self._host = Host(FMU, name, arguments, (message_descriptor,), folder)
        self._host.remark = self._last_message
        try:
            found = self._hear(name, "while it was loaded")
            self._host.process = found["process"]
            super().__init__(name, config, chosen_level(level, tuple(found["levels"]), name))
            self.level_from = f"{DECLARED} ({found['level_from']})" if found["level_from"] else DEFAULT
            self.wants = checked_wants(found["wants"], name, record.all_transducers)
            self.signals = checked_signals(found["signals"], name)
            # a parameter with the name of one of the rig's settings gets the rig's value
            self.settings = checked_settings(
                {key: value for key, value in found["settings"].items() if key not in self.info.parameters}, name
            )
            self._behind = struct.Struct(f"<{len(self.wants) + len(self.settings)}d")
            self._own_values = struct.Struct(f"<{len(self.signals)}d")
            order = {
                "level": self.level,
                "parameters": dict(self.info.parameters),
                "period": self.info.period,
                "settings": list(self.settings),
            }
            self._tell(order)
            self._hear(name, "while it was initialized")
        except BaseException:
            self._abandon()
            raise

    def _hear(self, name: str, when: str) -> dict:
        """Return the host's next message before the first step; RigError with its sentence, or when no message comes."""
        message = self._host.hear(when)
        if "error" in message:
            raise RigError(f"controller {name}: {message['error']}")
        return message

    def _last_message(self) -> str:
        """Return the newest message of an FMU that has gone or does not answer, as the end of a sentence."""
        text = os.pread(self._message_file.fileno(), MESSAGE, 0).decode("utf-8", "replace")
        return f"; its last message: {text}" if text else ""

    def _fail(self, status: Status, sample: int, text: str) -> NoReturn:
        if status == Status.FATAL and not text.startswith("status"):  # the FMU's own status comes with its reason
            text += self._last_message()
        super()._fail(status, sample, text)

    def _answer(self, inputs: ControllerInputs) -> ControllerOutputs:
        sample = self._sample.pack(inputs.sample, inputs.gear_request, *inputs.current, *inputs.measured)
        behind = self._behind.pack(*inputs.others.values(), *inputs.settings.values())
        data = self._asked(inputs.sample, sample + behind, self.step_timeout)
        if len(data) < self._answer_form.size or data[:8] != inputs.sample.to_bytes(8, "little"):
            self._fail(Status.FATAL, inputs.sample, self._host.unreadable(data))
        _, *four_and_values = self._answer_form.unpack_from(data)
        status, gear, shifting, flags = map(_whole, four_and_values[:4])
        if status != Status.OK:
            return ControllerOutputs(status=status, message=data[self._answer_form.size :].decode("utf-8", "replace"))
        numbers = (*four_and_values[4:], *self._own_values.unpack_from(data, self._answer_form.size))
        return self._outputs_in(numbers, gear, shifting, flags, Status.OK, "")

    def _abandon(self) -> None:
        super()._abandon()
        self._message_file.close()

    def _end(self) -> None:
        super()._end()
        self._message_file.close()


def _whole(value: float) -> float:
    """Return a whole number as an int, so that it is printed as one; the seam refuses any other."""
    return int(value) if value.is_integer() else value
