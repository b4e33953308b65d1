# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Makes the frames of a run on a CAN bus, from samples and answers: those of the CAN plug (bus.py) and of exported CAN logs.

The messages are those of database.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from ...rig import NEUTRAL
from ..record import STANDSTILL, ControllerRecord
from ..seam import ControllerInputs
from ..wire import commands, currents, measured
from . import database as frames
from . import j1939

RPM = 30.0 / math.pi
ENGAGED = 2.0  # % of slip below which a clutch counts as engaged


def percent(slip: float) -> float:
    """Return a slip, given as a share of the input speed, in % from 0 to 100; NaN stays NaN."""
    return slip if math.isnan(slip) else min(100.0 * abs(slip), 100.0)


class Gearbox:
    """The state of the clutches as pressures and speeds on the wires show it; it is for J1939, not for the controller.

    ``gear`` is the gear engaged last, None while a transducer has no reading; ``engaged`` is True while a clutch holds.
    """

    def __init__(self, record: ControllerRecord) -> None:
        self.gear: int | None = NEUTRAL
        self._last, self.engaged, self._record = NEUTRAL, False, record
        self._held = {
            gear.number: [(record.reader(name), kiss) for name, kiss in gear.presses]
            for gear in record.gears
            if gear.ratio is not None
        }

    def see(self, inputs: ControllerInputs, shifting: bool) -> None:
        """Take a sample; the gear stays through a shift until the new clutch holds, and is neutral when no clutch is pressed."""
        pressures = {gear: [(reader(inputs.measured), kiss) for reader, kiss in held] for gear, held in self._held.items()}
        slips = {gear: percent(self._record.slip(gear, inputs.measured)) for gear in self._held}
        if not all(map(math.isfinite, (*(p for held in pressures.values() for p, _ in held), *slips.values()))):
            self.gear, self.engaged = None, False
            return
        pressed = [gear for gear, held in pressures.items() if all(pressure > kiss for pressure, kiss in held)]
        holding = [gear for gear in pressed if slips[gear] < ENGAGED]
        self.engaged = bool(holding)
        if len(holding) == 1:
            self._last = holding[0]
        elif not pressed and not shifting:
            self._last = NEUTRAL
        self.gear = self._last


class RigFrames:
    """Makes the rig's frames of each sample, and those of answers.

    ``gear`` and ``shifting`` are what the controller has reported, the latter as two bits of J1939; their owner keeps them so.

    Parameters
    ----------
    record : ControllerRecord
        The rig's record.
    level : str
        Level of the run, "duty" or "current".
    put : callable
        ``put(number, data, extended)`` takes a frame.
    every : int
        Samples between two measurements.
    address : int
        The rig's source address in J1939.
    """

    def __init__(
        self,
        record: ControllerRecord,
        level: str,
        put: Callable[[int, bytes, bool], None],
        every: int = 1,
        address: int = frames.ADDRESS,
    ) -> None:
        self.gear, self.shifting = NEUTRAL, j1939.NOT_AVAILABLE
        self._record, self._level, self._put_frame, self._every, self._address = record, level, put, every, address
        self._by_name = {message.name: message for message in frames.database(record).messages}
        command = frames.COMMAND_CURRENT if level == "current" else frames.COMMAND_DUTY
        self._measured, self._currents = measured(record), currents(record)
        self._commands = commands(record, level)
        wires = {frames.MEASURED: self._measured, frames.CURRENTS: self._currents, command: self._commands}
        self._split = {
            name: [(one, [wire.name for wire in some]) for one, some in frames.split(name, wires[name])] for name in wires
        }
        self._gearbox, self._shown, self._requested = Gearbox(record), None, None

    def _put(self, name: str, values: dict) -> None:
        message = self._by_name[name]
        data = message.encode(values, scaling=False, strict=False, padding=message.is_extended_frame)
        number = message.frame_id
        if message.is_extended_frame:
            number = number & ~0xFF | self._address
        self._put_frame(number, data, message.is_extended_frame)

    def _put_all(self, name: str, values: dict, **head: int) -> None:
        """Put the frames over which values are split, each with ``head``."""
        for one, own in self._split[name]:
            self._put(one, {**head, **{key: values[key] for key in own}})

    def take(self, inputs: ControllerInputs, shifting: bool, groups: bool) -> None:
        """Put the frames of a sample.

        Parameters
        ----------
        inputs : ControllerInputs
            The sample.
        shifting : bool
            Whether the controller reports a shift.
        groups : bool
            Whether the rig may send J1939 groups now.
        """
        sample, request = inputs.sample, inputs.gear_request
        if request != self._requested or sample % frames.CYCLES[frames.REQUEST] == 0:
            self._requested = request
            self._put(frames.REQUEST, {"gear_request": request, "level": int(self._level == "current")})
        if sample % self._every == 0:
            self._put_all(frames.MEASURED, _raw(self._measured, inputs.measured))
            self._put_all(frames.CURRENTS, _raw(self._currents, inputs.current), sample=sample & 0xFFFF)
        self._gearbox.see(inputs, shifting)
        self._shown = inputs
        if groups and sample % frames.CYCLES[frames.ETC1] == 0:
            self.etc1()
        if groups and sample % frames.CYCLES[frames.ETC2] == 0:
            self.etc2()

    def etc1(self) -> None:
        """Put ETC1 of the newest sample, nothing before the first."""
        if self._shown is None:
            return
        gearbox, measured_now = self._gearbox, self._shown.measured
        n_in, n_out = self._record.speeds(measured_now)
        slip = percent(self._record.slip(self.gear, measured_now))
        self._put(
            frames.ETC1,
            {
                "TransDrivelineEngaged": j1939.ERROR if gearbox.gear is None else int(gearbox.engaged),
                "TransShiftInProcess": self.shifting,
                "TransOutputShaftSpeed": _two_bytes(n_out * RPM / 0.125),
                "PercentClutchSlip": round(slip / 0.4) if math.isfinite(slip) else j1939.ERROR_1,
                "TransInputShaftSpeed": _two_bytes(n_in * RPM / 0.125),
            },
        )

    def etc2(self) -> None:
        """Put ETC2 of the newest sample, nothing before the first."""
        if self._shown is None:
            return
        gear = self._gearbox.gear
        n_in, n_out = self._record.speeds(self._shown.measured)
        ratio = j1939.NONE_2  # at standstill there is no ratio
        if not math.isfinite(n_in) or not math.isfinite(n_out):
            ratio = j1939.ERROR_2
        elif n_out > STANDSTILL:
            ratio = _two_bytes(n_in / n_out / 0.001)
        self._put(
            frames.ETC2,
            {
                "TransSelectedGear": self._shown.gear_request + 125,
                "TransActualGearRatio": ratio,
                "TransCurrentGear": j1939.ERROR_1 if gear is None else gear + 125,
            },
        )

    def answer(self, sample: int, command: Sequence[float], gear: int, shifting: bool, flags: int) -> None:
        """Put the two plain frames of a controller's answer.

        Parameters
        ----------
        sample : int
            The sample that is answered.
        command : sequence of float
            Duty or current setpoint [A] of each output.
        gear : int
            Number of the gear taken last.
        shifting : bool
            Whether a shift is still running.
        flags : int
            Outputs that stay on at a setpoint of 0, a bit each.
        """
        name = frames.COMMAND_CURRENT if self._level == "current" else frames.COMMAND_DUTY
        echo = sample & 0xFFFF
        self._put(frames.STATE, {"sample": echo, "gear": gear, "shifting": int(shifting), "flags": flags, "status": 0})
        self._put_all(name, _raw(self._commands, command), sample=echo)


def _raw(wires: list, values: Iterable[float]) -> dict[str, int]:
    """Return the raw numbers by the names of their wires."""
    return {wire.name: wire.encode(value) for wire, value in zip(wires, values, strict=True)}


def _two_bytes(value: float) -> int:
    """Return the raw J1939 number of two bytes, below the reserved range; "error" for a value that is no finite number."""
    return round(min(max(value, 0), j1939.HIGHEST_2)) if math.isfinite(value) else j1939.ERROR_2
