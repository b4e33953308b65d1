# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The lockstep rig: one object that owns the plant, the instruments and, if it is embedded, the shift controller.

The devices of a rig are those of its description. By their roles the rig knows them as motor, load, oil, valves and
clutches. ``simulate``, the rig container and the tests use it; time passes only in ``advance_samples``.
"""

from __future__ import annotations

import hashlib
from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import COMMAND_TIMEOUT, SWITCH, RigError, unknown
from ..controllers import LEVELS, record_of
from ..plant import BY_DUTY, BY_LAW, BY_SETPOINT
from ..plant import alfa46_law as law
from ..plant import part as parts
from ..rig import (
    CONTROLLER,
    NO_ANSWER,
    NO_COMMAND,
    Alfa46Config,
    RigConfig,
    Setpoint,
    Setting,
    beyond_alfa46,
    check_enabled,
    check_gains,
)
from .commanded_rig import CommandedRig, check_level
from .cuts import Cuts
from .faults import Faults
from .gauges import Gauges
from .plan import plan_of
from .rig_base import RigStatus
from .shown_state import ShownState, facts_of
from .snapshot import Snapshot, physics

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

# plain values of a rig's state
VALUES = (
    *("sample", "config", "level", "reason", "tripped_by", "stopped_by_person", "idle_command"),
    *("_by", "_gear", "_shifting", "_flags", "_silent", "_trouble", "_last_command", "_arrived", "_held_open", "_ordered"),
    *("_under_way", "_arrived_row"),
)


def _channel(setting: Setting) -> str:
    """The transducer whose noise a setting gives."""
    return setting.key.partition(".")[2]


class Rig(CommandedRig, ShownState):
    """A rig that is made from its configuration.

    Attributes
    ----------
    faults : Faults or None
        Its faults; None while they are disabled.

    Parameters
    ----------
    config : RigConfig
        The rig's configuration.
    seed : int
        Seed of the transducers' errors and noise.
    controller : str
        "embedded" runs the Alfa46 inside the rig; "external" waits for commands of the given ``level``, and "plugged" too, whose
        caller gives the controller each sample by :meth:`handed`.
    level : str or None
        Level of an external controller's commands: "duty" of the coils, or "current" setpoints for the rig's own power
        stage; None takes the level of the first command.
    devices : str
        "embedded" runs the devices that the configuration cuts out inside the rig as well; with "external" their answers
        come from outside.
    delay : int
        Number of samples from the sample that a command answers to the boundary at which the command acts. It is always 1
        for an embedded controller.

    Raises
    ------
    RigError
        When an argument is none of those above, when ``level`` has no effect on this rig, or when the rig
        has more outputs than the embedded Alfa46.
    """

    def __init__(
        self,
        config: RigConfig,
        seed: int = 1,
        controller: str = "embedded",
        level: str | None = "duty",
        devices: str = "embedded",
        delay: int = 1,
    ) -> None:
        if devices not in ("embedded", "external"):
            raise RigError(f"devices is '{devices}', expected 'embedded' or 'external'")
        if controller not in ("embedded", "external", "plugged"):
            raise RigError(f"controller is '{controller}', expected 'embedded', 'external' or 'plugged'")
        if delay < 0 or (delay != 1 and controller == "embedded"):
            raise RigError(f"delay is {delay}, expected 0 or more samples of an external controller, or 1")
        if level not in (None, *LEVELS):
            raise RigError(f"level is '{level}', expected 'duty' or 'current'")
        self.shifts = config.structure.shifts  # there is a shift controller, in it or outside
        if controller != "embedded" and self.shifts:
            check_level(config, level)
        self._first = self.config = config
        self.seed, self.level = int(seed), level if self.shifts else None
        self.settings = config.settings
        self.embedded, self.plugged = controller == "embedded" and self.shifts, controller == "plugged"
        if self.embedded and (why := beyond_alfa46(config.transmission)):
            raise RigError(why)
        self.count_steps(config.kernel.step, config.instruments.logger_rate, config.catalogue)
        self._build()
        self.take_no_command(config)
        self._wired = [self.channels.index(name) for name in record_of(config).names] if self.shifts else []
        self._by = BY_LAW if self.embedded else BY_SETPOINT if level == "current" else BY_DUTY
        self.cuts = Cuts(self, devices == "embedded")
        self.delay = delay
        self.faults = Faults(self) if config.faults is not None else None

    def _build(self) -> None:
        config, structure = self.config, self.config.structure
        if not structure.of_role(parts.SOURCE):
            raise RigError(f"the rig '{config.name}' cannot be run without a drive among its parts, e.g. part: dc_motor")
        self.drive = structure.of_role(parts.SOURCE)[0].name
        planned = plan_of(config)
        self.build(
            planned.plan, Gauges(config, self.seed, tuple(planned.plan.channels)), config.trips if config.trips_watched else ()
        )
        self.facts = facts_of(config, self.world, planned.true)
        self.clutch_names = self.facts.clutches
        self.valve_names = tuple(one.name for one in structure.valves)
        self.motor = self.device(self.drive)
        self._single = memoryview(self.world.numbers)  # from which a single number is read in a third of the time
        self._drive_on = self.world.states_at(self.drive)["enabled"]
        self.load, self.oil = (
            {one.role: self.device(one.name) for one in reversed(structure.devices) if one.role in (parts.LOAD, parts.OIL)}.get(
                role
            )
            for role in (parts.LOAD, parts.OIL)
        )
        self._currents = [
            (self.channels.index(planned.plan.currents[name]), output)  # column and output of each valve's current
            for name, output in zip(self.valve_names, config.wiring)
        ]
        self.valves = [self.device(name) for name in self.valve_names]
        self.clutches = [self.device(name) for name in self.clutch_names]
        self.stored_first = self.stored()
        if self.shifts:
            self._law_config[:] = config.alfa46.law_config(config.transmission)
            self._law_profiles[:] = config.alfa46.profiles
            # loaded before anything is recorded: LLVM aborts the process when it gets no memory for a function
            law.order_gear.entry_for(0, self.sample, self._law_config[0], self._law_profiles, self._law_outputs, self._law_state[0])

    # ---- time

    def advance_samples(self, samples: int = 1) -> None:
        """Move plant, instruments and embedded controller by a number of controller samples; the GIL is released inside."""
        if self._ordered is not None and samples > 0:
            law.order_gear(
                self._ordered, self.sample, self._law_config[0], self._law_profiles, self._law_outputs, self._law_state[0]
            )
            self._ordered = None
        for part in self.cuts.split(samples):
            if not self._advance_acting(part):
                break
        if self.safe:
            return
        if self.shifts and not self.embedded and self._last_command >= 0 and self.command_age > COMMAND_TIMEOUT:
            self._silent = True
            self.trip(self._silence(), NO_COMMAND)
        elif silence := self.cuts.silence():
            self.trip(silence, NO_ANSWER)

    def _advance_acting(self, samples: int) -> bool:
        """Move by samples and let every command act at its boundary; False when the plant trips the rig before the end."""
        end, faults = self.sample + samples, self.faults
        while self.sample < end:
            self._act_due()
            upto = min(end, self._to_come[0][0] if self._to_come else end)
            whole = self.move((upto if faults is None else min(upto, faults.next)) - self.sample)
            if faults is not None:
                faults.act()
            if not whole:
                return False
        return True

    # ---- commands, applied at the next sample boundary

    def set(self, step: str, value: float, enable: bool) -> None:
        """Give a device a setpoint and switch the device on or off.

        Parameters
        ----------
        step : str
            Key of the device in sequences, e.g. motor, load or oil.
        value : float
            The setpoint [SI].
        enable : bool
            True when the device is on.

        Raises
        ------
        RigError
            When the key is unknown, the rig lacks what the setpoint needs, or the value is out of its range.
        """
        if step not in self.settings.steps:
            raise RigError(unknown("setpoint", step, self.settings.steps))
        setting = self.settings.steps[step]
        setpoint = setting.setpoint
        if setting.lacking:
            what = setpoint.command.only.replace("_", " ")
            raise RigError(f"'{self.config.name}' has no {what}; its {setting.lacking} is off")
        setting.check(value)
        me = self.device(setpoint.device)
        me[setpoint.command.target], me[setpoint.command.enabled] = value, enable

    def set_value(self, name: str, value: float) -> None:
        """Change a setting of the rig while it runs; ``config`` follows.

        Parameters
        ----------
        name : str
            Name of the setting, e.g. "motor.speed" or "motor.enabled".
        value : bool or float
            The new value [SI]; True or False for a switch.

        Raises
        ------
        RigError
            When the change is refused.
        """
        setting = self.settings.find(name)
        setting.check_lives()
        if setting.dimension != SWITCH:
            setting.check(value)
        if setting.setpoint:
            now = self.device(setting.setpoint.device)
            target, on = (now[getattr(setting.setpoint.command, what)] for what in ("target", "enabled"))
            self.set(setting.setpoint.step, *((target, bool(value)) if setting.dimension == SWITCH else (value, bool(on > 0.0))))
        elif setting.state:
            shifted = self.faults.shifted(setting.owner, setting.state) if self.faults is not None else 0.0
            self.device(setting.owner)[setting.state] = value + shifted
            self.config = self.config.with_values({name: float(value)})
        elif setting.owner == CONTROLLER:
            if not self.embedded:
                raise RigError(f"{name} is the shift controller's, and not the rig's to change")
            check_gains(self.level, [setting.key])
            self.set_controller(self.config.with_values({name: value}).alfa46)
        else:
            if self.faults is not None:
                self.faults.lift()
            if setting.dimension == SWITCH:
                self.gauges.switch(bool(value))
            else:
                self.gauges.set_noise(_channel(setting), value)
            if self.faults is not None:
                self.faults.apply()

    def order_fault(self, text: str) -> None:
        """Take an order of a fault as rig.faults.read_fault reads it; RigError when it is refused, or faults are disabled."""
        check_enabled(self.config, "fault refused")
        self.faults.order(text)

    def swap_wires(self, name: str, other: str) -> None:
        """Exchange the wires of two transducers."""
        places, source = [self.channels.index(name), self.channels.index(other)], self._shown["source"][0]
        source[places] = source[places[::-1]]

    def value(self, name: str) -> bool | float:
        """Return the value [SI], as it was last set, of a setting that can be changed while the rig runs."""
        setting = self.settings.find(name)
        if setting.setpoint:
            command, me = setting.setpoint.command, self.device(setting.setpoint.device)
            return bool(me[command.enabled] > 0.0) if setting.dimension == SWITCH else float(me[command.target])
        if setting.state:
            return float(self.config.value(name))  # as it was last set; the state moves on from there
        return self.gauges.on if setting.dimension == SWITCH else self.gauges.noise(_channel(setting))

    def refuses_drive(self, setpoint: Setpoint) -> bool:
        """Return whether a setpoint belongs to the device that drives a tripped rig, which can only be switched off."""
        drives = self.config.structure.device(setpoint.device).role == parts.SOURCE and not setpoint.command.node
        return drives and self.status == RigStatus.TRIPPED

    # ---- safe state

    @property
    def status(self) -> RigStatus:
        """The rig's present state, as in rig_msgs/RigState."""
        if self.safe:
            return RigStatus.TRIPPED
        if self.shifts and (self.newest_command < 0 or self._held_open):
            return RigStatus.STARTING
        return RigStatus.RUNNING if self.number(self._drive_on) > 0.0 else RigStatus.READY

    def reset(self) -> None:
        """Leave the safe state.

        All that drives stays off, and no clutch is clamped before it is ordered again. The embedded controller begins in neutral; a
        controller outside must have been in neutral before its commands act again. Until then the status is "starting".

        Raises
        ------
        RigError
            When the rig is not in its safe state.
        """
        self.check_tripped()
        self._safe[0] = 0.0
        for one in (setting.setpoint for setting in self.settings.steps.values()):
            if not self.shifts or self.config.structure.device(one.device).role == parts.SOURCE:
                self.device(one.device)[one.command.enabled] = 0.0
        self.reason, self.tripped_by, self.stopped_by_person = "", "", False
        self.watched.reset()
        self._silent, self._trouble = False, ""
        self._last_command, self._arrived, self._gear, self._shifting = -1, -1, 0, False
        self._to_come.clear()
        self._under_way, self._arrived_row = (), []
        for valve in self.valves:
            valve["pending"] = 0.0
        self.cuts.excuse()
        self._law_outputs[:] = np.zeros(1, law.LAW_OUTPUT)
        self._law_state["gear"] = self._law_state["shift_end"] = 0
        self._ordered, self._held_open = None, self.shifts and not self.embedded

    # ---- what can be read

    @property
    def gear(self) -> int:
        """Number of the gear that was ordered last from the controller."""
        return int(self._law_state["gear"][0]) if self.embedded else self._gear

    @property
    def shifting(self) -> bool:
        """True while a profile of the controller runs."""
        if self.embedded:
            return bool(self._law_state["sample"][0] < self._law_state["shift_end"][0])
        return self._shifting

    @property
    def shift_end(self) -> int:
        """Sample at which the last profile of the embedded controller's newest shift ends; 0 before the first shift."""
        return int(self._law_state["shift_end"][0])

    @property
    def duty(self) -> np.ndarray:
        """Duty that the controller commands (outputs,), which acts from the next boundary on; 0 at level "current"."""
        return self._law_outputs["duty"] if self.embedded else self._duty

    @property
    def flags(self) -> int:
        """Bits of the newest command at level "current": the outputs that stay on at a setpoint of zero."""
        return self._flags

    @property
    def setpoint(self) -> np.ndarray:
        """Current setpoints of the controller's outputs (outputs,) [A]."""
        return self._law_outputs["setpoint"] if self.embedded else self._setpoint

    def coil_duty(self, name: str) -> float:
        """Return the duty, 0 to 1, on the coil of a valve from this sample on."""
        k = self.valve_names.index(name)
        if self.status == RigStatus.TRIPPED:
            return 0.0
        if self.embedded or self.level == "current":
            return float(self.duty[self._wiring[k]])
        self._act_due()
        return float(self.valves[k]["pending"])

    def seen(self, row: Sequence[Any] | None = None) -> tuple[list[Any], list[Any]]:
        """Return what the controller's newest sample carries.

        Parameters
        ----------
        row : (channels,) sequence, optional
            Logger row of another sample [SI]; with an array (n,) for each channel the result is that of n samples, but stays 0 for
            outputs without a valve.

        Returns
        -------
        currents : (outputs,) list of float
            Measured coil current at each output of the controller [A].
        measured : (transducers,) list of float
            Values of the controller's transducers in the order of its record [SI].
        """
        row, currents = self.row().tolist() if row is None else row, list(self._nothing)
        for column, output in self._currents:
            currents[output] = row[column]
        return currents, [row[column] for column in self._wired]

    def coil_currents(self) -> np.ndarray:
        """Return the measured currents at the controller's outputs (outputs,) [A]."""
        return np.array(self.seen()[0])

    def number(self, place: int) -> float:
        """Return a number of the plant by its place in the world."""
        return self._single[place]

    def entries(self, array: str, row: int | None = None) -> list:
        """Return the numbers of an array of the driveline's record, or of one of its rows."""
        numbers = self.world.line[array]
        return (numbers if row is None else numbers[row]).tolist()

    def each(self, function: Callable[[np.void], float]) -> float:
        """Return the value that a function takes of the driveline's record."""
        return function(self.world.line)

    def clutch_mode(self, clutch: int | str) -> int:
        """Return the mode of a clutch, as in rig_msgs/ClutchState.

        Parameters
        ----------
        clutch : int or str
            Name of the clutch, or its place among the rig's clutches.

        Returns
        -------
        int
            0 open, 1 slipping, 2 locked.
        """
        return int(super().clutch_mode(self._clutch(clutch)))

    def _clutch(self, clutch: int | str) -> str:
        return clutch if isinstance(clutch, str) else self.clutch_names[clutch]

    def clutch_torque(self, clutch: int | str) -> float:
        """Return the :meth:`friction_torque` of a clutch, given by its name or its place [Nm]."""
        return self.friction_torque(self._clutch(clutch))

    def slip(self, clutch: int | str) -> float:
        """Return the slip [rad/s] of a clutch that is given by its name or its place among the rig's clutches."""
        return super().slip(self._clutch(clutch))

    def supply_pressure(self, valve: str) -> float:
        """Return the pressure of the oil supply of a valve [Pa, gauge]."""
        structure = self.config.structure
        return float(self.device(structure.oil_of(structure.device(valve), "supply"))["pressure"])

    def line_pressure(self, clutch: int | str) -> float:
        """Return the pressure of a clutch where its transducer is [Pa, gauge]."""
        return self.true(f"{self._clutch(clutch)}.pressure")

    def load_torque(self) -> float:
        """Return the torque of the load against the output shaft [Nm]."""
        return self.friction_torque(self.facts.loads[0])

    # ---- the state, saved and restored

    @property
    def _made(self) -> dict[str, Any]:
        """What the rig was made from, besides its configuration."""
        devices, controller = ("embedded" if inside else "external" for inside in (self.cuts.embedded, self.embedded))
        return {"seed": self.seed, "controller": controller, "devices": devices, "delay": self.delay}

    def _arrays(self) -> tuple[np.ndarray, ...]:
        """Everything that a step or a setting changes, without the rings."""
        law_of = (self._law_config, self._law_profiles, self._law_outputs, self._law_state)
        watch = (self.watched.arrays.trips, self.watched.arrays.said, self.watched.arrays.stays)
        return (self.world.record, *law_of, self._duty, self._setpoint, *self.gauges.moved, *watch)

    def _places(self) -> list[int]:
        """Places in the ring of the rows that the next step reads: of this sample and of that before it."""
        return [sample * self._steps_per_sample % len(self._log) for sample in (self.sample, max(0, self.sample - 1))]

    def snapshot(self) -> Snapshot:
        """Return the present state, for :meth:`restore`."""
        if self.faults is not None:
            self.faults.lift()
        now = Snapshot(
            self._first,
            self._made,
            {name: getattr(self, name) for name in VALUES},
            tuple((boundary, act.__name__, *values) for boundary, act, *values in self._to_come),
            (*(one.copy() for one in self._arrays()), self._log[self._places()]),
            (self.gauges.on, self.gauges.changes),
            self.cuts.snapshot(),
            self.faults.snapshot() if self.faults is not None else (),
            physics(),
        )
        if self.faults is not None:
            self.faults.apply()
        return now

    def restore(self, snapshot: Snapshot) -> None:
        """Return to a state in which a rig of the same configuration and seed was; older rows, and warnings not taken, are lost.

        Parameters
        ----------
        snapshot : Snapshot
            A result of :meth:`snapshot`.

        Raises
        ------
        RigError
            When the snapshot is of a rig that was made from something else, or of another version.
        """
        snapshot.check_fits(self._first, self._made)
        if self.faults is not None:
            self.faults.lift()
        for name, value in snapshot.values.items():
            setattr(self, name, value)
        self._to_come = deque((boundary, getattr(self, act), *values) for boundary, act, *values in snapshot.to_come)
        *arrays, rows = snapshot.arrays
        for one, value in zip(self._arrays(), arrays):
            one[...] = value
        self._log[self._places()] = rows
        self.watched.look_anew()
        self.gauges.on, self.gauges.changes = snapshot.noise
        self.cuts.restore(snapshot.cuts)
        self._drained = 0
        self.warnings.clear()
        if self.faults is not None:
            self.faults.restore(snapshot.faults)

    def set_controller(self, settings: Alfa46Config) -> None:
        """Give the embedded controller other settings from the next sample on; a profile that is running takes its new points."""
        self._law_config[:] = settings.law_config(self.config.transmission)
        self._law_profiles[:] = settings.profiles
        self.config = replace(self.config, alfa46=settings)
        if self.faults is not None:
            self.faults.apply()  # on the new points

    def state_hash(self) -> str:
        """Return a digest of the whole state; it is equal for equal histories, however these were divided into calls."""
        digest = hashlib.sha256()
        for part in (self.world.moved, self._law_outputs, self._law_state, self.gauges.state, self.gauges.counts):
            digest.update(np.ascontiguousarray(part).tobytes())
        digest.update(str(self.sample).encode())
        return digest.hexdigest()
