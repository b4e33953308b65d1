# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plant's ends of the cuts of a rig: ports out, answers in, a tick of delay, and what silence means.

Owned by testbench.rig. Without cut devices it does nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from ..clocks import COMMAND_TIMEOUT, SAMPLE
from ..engine.outside import LOAD, MOTOR, NOTHING, VALVE, Answer, OtherSide, Port, drained
from ..errors import RigError

if TYPE_CHECKING:
    from .rig import Rig


def topic_of(device: str, end: str) -> str:
    """Topic of one end, "port" or "answer", of a device's cut."""
    return f"/{device}/cut/{end}"


class Cuts:
    """Ticks count in controller samples from time 0. The answer to sample s acts from the next tick on."""

    def __init__(self, rig: Rig, embedded: bool) -> None:
        """embedded: the rig's own other sides answer; else answers come by :meth:`answer`."""
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
        """The parts in which the rig moves by so many samples; a tick begins before its part comes."""
        if not self.devices:
            yield samples
            return
        end = self._rig.sample + samples
        while (now := self._rig.sample) < end:
            if now % self.samples == 0:
                self._begin()
            yield min(end - now, self.samples - now % self.samples)

    def _begin(self) -> None:
        """A tick begins: the newest answers act, and the other sides that are inside answer the new ports."""
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
        """True when ports are to go out at the rig's sample."""
        return bool(self.devices) and self._rig.sample % self.samples == 0

    def port(self, device: str) -> Port:
        """The port of a device now."""
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
        """(sample, answer) of the newest answer of a device; sample -1 before the first."""
        return self._newest[device]

    def answer(self, device: str, sample: int, answer: Answer) -> None:
        """Take a device's answer to a sample; RigError when it is refused."""
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
        """Energy over a cut since time 0 as the plant counts it [J], signed as ``Answer.work``."""
        energy = self._rig.energy()
        part = self._parts[device]
        return float(self._rig.device(device)["work"]) if part == VALVE else energy["motor" if part == MOTOR else "load"]

    # ---- silence

    def excuse(self) -> None:
        """Count silence from now on."""
        self._since = self._rig.sample

    def silence(self) -> str | None:
        """The sentence on a device whose newest answer is too old, None when there is none."""
        for device in self.devices:
            if self._is_silent(device):
                return f"{device}: no answer on {topic_of(device, 'answer')} for {COMMAND_TIMEOUT * 1e3:.0f} ms"
        return None

    def _is_silent(self, device: str) -> bool:
        return self._rig.sample - max(self._newest[device][0], self._since) > round(COMMAND_TIMEOUT / SAMPLE)

    def _stand_in(self, device: str) -> Answer:
        """What acts for a silent device: no torque, and the way to the tank open."""
        if self._parts[device] != VALVE:
            return NOTHING
        return drained(self._rig.fed_pressure(device), self._rig.config, device)
