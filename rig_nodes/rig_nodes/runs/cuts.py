# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plant's side of the cuts of a rig: ports out, answers in, a delay of one tick, and what a missing answer causes.

runs.rig owns it. It does nothing without cut devices.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from ..base import COMMAND_TIMEOUT, SAMPLE, RigError
from ..plant import LOAD, MOTOR, NOTHING, VALVE, Answer, OtherSide, Port, drained

if TYPE_CHECKING:
    from .rig import Rig


def topic_of(device: str, end: str) -> str:
    """Return the topic of one end, "port" or "answer", of a device's cut."""
    return f"/{device}/cut/{end}"


class Cuts:
    """The cuts of a rig; ticks are counted in controller samples from time 0, and an answer acts from the next tick on.

    Parameters
    ----------
    rig : Rig
        The rig that owns the cuts.
    embedded : bool
        True when the rig's own other sides answer; with False the answers come through :meth:`answer`.
    """

    def __init__(self, rig: Rig, embedded: bool) -> None:
        """Connect the cut devices; the class describes the parameters."""
        config = rig.config
        self.devices, self.embedded = config.cut_out, embedded
        self.samples = round(config.cut.tick / SAMPLE)
        self._rig = rig
        self._sides = {device: OtherSide(device, config) for device in self.devices if embedded}
        self._newest = dict.fromkeys(self.devices, (-1, NOTHING))  # sample answered, answer
        self._since = 0  # sample from which silence counts
        self._parts = {device.name: device.part for device in config.structure.devices}
        for name in config.cuttable:
            rig.device(name)["cut" if self._parts[name] == VALVE else "held"] = name in self.devices

    # ---- time

    def split(self, samples: int) -> Iterator[int]:
        """Yield the parts [samples] in which the rig moves by a number of samples; a tick begins before its part is yielded."""
        if not self.devices:
            yield samples
            return
        end = self._rig.sample + samples
        while (now := self._rig.sample) < end:
            if now % self.samples == 0:
                self._begin()
            yield min(end - now, self.samples - now % self.samples)

    def _begin(self) -> None:
        """Begin a tick: the newest answers act, and the other sides inside the rig answer the new ports."""
        rig = self._rig
        for device in self.devices:
            answer = self._stand_in(device) if self._is_silent(device) else self._newest[device][1]
            me, part = rig.device(device), self._parts[device]
            if part == MOTOR:
                me["held_torque"], me["held_setpoint"] = answer.torque, answer.setpoint
            elif part == LOAD:
                me["held_capacity"], me["held_pressure"] = max(0.0, answer.torque), answer.pressure
            else:
                me["cut_flow"], me["cut_slope"] = answer.flow, answer.flow_slope
                me["cut_pressure"], me["spool"] = answer.pressure, answer.position
        for device, side in self._sides.items():
            self._newest[device] = rig.sample, side.step(self.port(device))

    def is_due(self) -> bool:
        """Return whether ports are sent at the rig's present sample."""
        return bool(self.devices) and self._rig.sample % self.samples == 0

    def port(self, device: str) -> Port:
        """Return the present port of a device."""
        rig = self._rig
        tick, safe = self.samples * SAMPLE, rig.safe
        me, part = rig.device(device), self._parts[device]
        if part in (MOTOR, LOAD):
            return Port(
                tick,
                speed=rig.speed_at(device),
                setpoint=float(me["target" if part == MOTOR else "setting"]),
                enable=bool(me["enabled"] > 0.0),
                safe=safe,
            )
        return Port(
            tick,
            pressure=rig.fed_pressure(device),
            supply=rig.supply_pressure(device),
            current=float(me["current"]),
            setpoint=rig.coil_duty(device),
            enable=not safe,
            safe=safe,
        )

    # ---- answers

    def answered(self, device: str) -> tuple[int, Answer]:
        """Return the newest answer of a device.

        Returns
        -------
        sample : int
            The sample that is answered; -1 before the first answer.
        answer : Answer
            The answer.
        """
        return self._newest[device]

    def answer(self, device: str, sample: int, answer: Answer) -> None:
        """Take a device's answer to a sample.

        Parameters
        ----------
        device : str
            Name of the device.
        sample : int
            The controller sample that is answered.
        answer : Answer
            The answer.

        Raises
        ------
        RigError
            When a value is not finite, ``flow_slope`` is positive, or the sample was answered before or is still to come.
        """
        what = f"answer of {device} to sample {sample} refused"
        if not all(map(math.isfinite, answer)):
            raise RigError(f"{what}: its values must be finite numbers, found {answer}")
        if answer.flow_slope > 0.0:
            raise RigError(
                f"{what}: flow_slope must be 0 or negative, found {answer.flow_slope:g}; a flow "
                "that grows with its port pressure would not be stable"
            )
        last, now = self._newest[device][0], self._rig.sample
        if not last < sample <= now:
            raise RigError(f"{what}: expected one after {last} and not after {now}")
        self._newest[device] = sample, answer

    def work(self, device: str) -> float:
        """Return the energy over a cut since time 0 as the plant counts it [J], with the sign of ``Answer.work``."""
        energy = self._rig.energy()
        part = self._parts[device]
        return float(self._rig.device(device)["work"]) if part == VALVE else energy["motor" if part == MOTOR else "load"]

    # ---- missing answers

    def excuse(self) -> None:
        """Count the time without an answer from now on."""
        self._since = self._rig.sample

    def silence(self) -> str | None:
        """Return the message on a device whose newest answer is too old; None when there is no such device."""
        for device in self.devices:
            if self._is_silent(device):
                return f"{device}: no answer on {topic_of(device, 'answer')} for {COMMAND_TIMEOUT * 1e3:.0f} ms"
        return None

    # ---- saved and restored

    def snapshot(self) -> tuple:
        """Return the answers and the states of the other sides inside the rig, for :meth:`restore`."""
        return dict(self._newest), self._since, {device: side.snapshot() for device, side in self._sides.items()}

    def restore(self, snapshot: tuple) -> None:
        """Return to what :meth:`snapshot` gave."""
        newest, self._since, sides = snapshot
        self._newest = dict(newest)
        for device, side in sides.items():
            self._sides[device].restore(side)

    def _is_silent(self, device: str) -> bool:
        return self._rig.sample - max(self._newest[device][0], self._since) > round(COMMAND_TIMEOUT / SAMPLE)

    def _stand_in(self, device: str) -> Answer:
        """What acts in place of a missing answer: no torque, and the way to the tank open."""
        if self._parts[device] != VALVE:
            return NOTHING
        return drained(self._rig.fed_pressure(device), self._rig.config, device)
