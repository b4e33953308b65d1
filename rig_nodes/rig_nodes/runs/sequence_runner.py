# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs a test sequence on a bench: gives its orders, awaits its conditions, and says which step did not end.

A bench is the rig in this process (runs.simulation), the graph (nodes.ros_bench) or an FMU's master (runs.fmu.drive).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from ..base import RigError
from ..plant import relief_setting_for

if TYPE_CHECKING:
    from ..rig import RigConfig
    from .sequence import Sequence, Step


class SequenceFailed(RigError):
    """A step that did not end; the message names the step, what it waited for and what was measured."""

    exit_code = 1


class Bench(Protocol):
    """What a sequence needs of a rig; all times are simulated seconds."""

    def ready(self) -> bool:
        """Return whether the rig can take orders."""

    def set(self, step: str, value: float, enable: bool) -> None:
        """Give a device a setpoint and switch the device on or off.

        Parameters
        ----------
        step : str
            Key of the device's step, e.g. motor or oil.
        value : float
            The setpoint [SI].
        enable : bool
            True when the device is on.
        """

    def order_gear(self, gear: int) -> None:
        """Order a gear by its number."""

    def shift_done(self) -> bool:
        """Return whether the shift that was ordered last has ended."""

    def controller_gear(self) -> tuple[int, bool] | None:
        """Return the controller's gear, and True when it is shifting; None before the controller has reported it."""

    def change(self, name: str, value: float) -> None:
        """Give a setting of the rig, its shift controller or the user's controller another value [SI]; a switch takes 1 or 0."""

    def fault(self, order: str) -> None:
        """Order a fault or its end, as rig.faults.read_fault takes it."""

    def changed(self) -> bool:
        """Return whether the setting that was changed last has its new value, or the fault that was ordered last was taken."""

    def reading(self, signal: str) -> float:
        """Return the newest value of a signal [SI]."""

    def event(self, name: str, text: str, value: float = 0.0) -> None:
        """Publish an event of the sequence."""


class SequenceRunner:
    """Runs a sequence on a bench; ``poll`` is called at every graph tick, with rising simulated time.

    Parameters
    ----------
    sequence : Sequence
        The sequence to run.
    bench : Bench
        Takes the orders and gives the readings.
    config : RigConfig
        The rig's configuration.
    """

    def __init__(self, sequence: Sequence, bench: Bench, config: RigConfig) -> None:
        """Start at the readiness gate; the class describes the parameters."""
        self.sequence, self.bench, self.config = sequence, bench, config
        self.step = -1  # -1: readiness gate
        self.text = "wait for the rig to be ready"
        self._since: float | None = None
        self._met_since: float | None = None

    @property
    def steps(self) -> int:
        """Number of steps, with repeats written out."""
        return len(self.sequence.steps)

    def poll(self, t: float) -> bool:
        """Do what is due at a time.

        Parameters
        ----------
        t : float
            Simulated time [s].

        Returns
        -------
        bool
            True when the last step is done.

        Raises
        ------
        SequenceFailed
            When a step did not end in time, or when its order was refused.
        """
        if self._since is None:
            self._since = t
        if self.step < 0:
            if not self.bench.ready():
                if t - self._since > self.sequence.ready_timeout:
                    raise SequenceFailed(
                        f"sequence '{self.sequence.name}': the rig was not ready within {self.sequence.ready_timeout:g} s"
                    )
                return False
            self._begin(0, t)
        while self.step < self.steps:
            if not self._ended(self.sequence.steps[self.step], t):
                return False
            self._begin(self.step + 1, t)
        return True

    def next_look(self) -> dict:
        """Return when :meth:`poll` has something to do again, so that it need not be called at every tick.

        Returns
        -------
        dict
            ``until``: the latest time [s]. Poll earlier as soon as ``signal`` lies between ``low`` and ``high`` (or no longer
            does, when ``met`` is False), or as soon as a shift to ``gear`` is done, where these keys are given.
        """
        if not 0 <= self.step < self.steps:
            return {"until": 0.0}
        step = self.sequence.steps[self.step]
        if step.kind == "shift":
            return {"until": self._since + step.timeout, "gear": int(step.value)}
        if step.kind in ("set", "fault"):
            return {"until": self._since}  # its answer is not a signal, so poll asks for it at every tick
        if step.condition is None:
            return {"until": self._since + step.value}
        condition, met = step.condition, self._met_since is not None
        return {
            "until": self._met_since + step.hold if met else self._since + step.timeout,
            "signal": condition.signal,
            "low": condition.low,
            "high": condition.high,
            "met": not met,
        }

    def _begin(self, index: int, t: float) -> None:
        self.step, self._since, self._met_since = index, t, None
        if index >= self.steps:
            self.text = "done"
            self.bench.event("sequence_done", f"sequence {self.sequence.name} is done", float(index))
            return
        step = self.sequence.steps[index]
        self.text = step.text
        self.bench.event("step", step.text, float(index + 1))
        try:
            self._give(step)
        except SequenceFailed:
            raise
        except RigError as error:
            raise SequenceFailed(f"{step.where}: {error}") from None

    def _give(self, step: Step) -> None:
        """Give the order of a step, if it has one; RigError when the rig or its controller refuses it."""
        if step.kind == "shift":
            self.bench.order_gear(int(step.value))
        elif step.kind == "set":
            self.bench.change(step.setting, step.value)
        elif step.kind == "fault":
            self.bench.fault(step.fault)
        elif step.kind != "wait":
            if not step.by_torque:
                self.bench.set(step.kind, step.value, step.enable)
                return
            load = self.config.settings.steps[step.kind].setpoint.device
            speed = self.bench.reading(self.config.structure.speed_of_load(load))
            try:
                self.bench.set(step.kind, relief_setting_for(step.value, speed, self.config.values(load)), step.enable)
            except RigError as error:
                raise RigError(f"{step.text} needs too much of the relief valve at this speed: {error}") from None

    def _ended(self, step: Step, t: float) -> bool:
        waited = t - self._since
        if step.kind == "shift":
            done = waited > 0.0 and self.bench.shift_done()
        elif step.kind in ("set", "fault"):
            done = self.bench.changed()
        elif step.condition is not None:
            condition = step.condition
            if not condition.low <= self.bench.reading(condition.signal) <= condition.high:
                self._met_since = None
            elif self._met_since is None:
                self._met_since = t
            done = self._met_since is not None and t - self._met_since >= step.hold
        elif step.kind == "wait":
            return waited >= step.value - 1e-9
        else:
            return True
        if not done and waited > step.timeout:
            seen, failed = "", "did not come true"
            if step.condition is not None:
                signal = self.config.catalogue.signal(step.condition.signal)
                value = signal.shown(self.bench.reading(signal.name))
                seen = f"; {signal.name} is {value:.4g} {signal.display_unit}"
                if step.hold > 0.0:
                    failed = f"did not stay true for {step.hold:g} s"
            elif step.kind == "shift" and (says := self.bench.controller_gear()) is not None:
                seen = f"; the controller reports gear {says[0]}, {'shifting' if says[1] else 'not shifting'}"
            raise SequenceFailed(f"{step.where}: '{step.text}' {failed} within {step.timeout:g} s{seen}")
        return done
