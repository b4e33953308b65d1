# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What goes between a rig and its shift controller: samples and commands of one outside, their age, and orders for one inside.

runs.rig.Rig derives from it; verbs check a controller's level by it before a run.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import COMMAND_TIMEOUT, SAMPLE_NS, RigError
from ..controllers import LEVELS, refusal
from ..plant import BY_DUTY, BY_SETPOINT, MEASUREMENTS, MESSAGES
from ..plant import alfa46_law as law
from ..rig import BAD_CONTROLLER
from .faults import NEVER
from .rig_base import RigBase

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from ..rig import RigConfig
    from .faults import Faults


def check_level(config: RigConfig, level: str | None) -> None:
    """Refuse a level of an external controller at which its commands have no effect on this rig.

    Parameters
    ----------
    config : RigConfig
        The rig's configuration.
    level : str or None
        Level of the controller's commands, "duty" or "current"; None when it is not known yet.

    Raises
    ------
    RigError
        When the level is "duty" and the effect ``current_loop`` is off.
    """
    if level == "duty" and not config.effects.current_loop:
        raise RigError(
            "effects.current_loop=off makes the coil current follow its setpoint, which a controller at level "
            "duty does not give; run one that gives it at level current (--level current), or leave the loop on"
        )


class CommandedRig(RigBase):
    """A rig with valves for a shift controller.

    Attributes
    ----------
    config : RigConfig
        The rig's configuration.
    shifts : bool
        True when it has a shift controller, inside or outside.
    embedded : bool
        True when the controller runs inside.
    plugged : bool
        True when one outside is given each sample by :meth:`handed`.
    level : str or None
        Level of the commands of a controller outside; None before the first one decides it.
    delay : int
        Samples from the one that a command answers to the boundary at which it acts.
    valve_names : tuple of str
        Names of the valves.
    valves : list
        Their records.
    faults : Faults or None
        Its faults; None while they are disabled.
    idle_command : str
        Why the newest command was taken but does not act; empty when it acts.
    asked_from : int
        Sample from which a controller outside is asked: 0, or that of :meth:`ask_anew`.
    """

    config: RigConfig
    shifts: bool
    embedded: bool
    plugged: bool
    level: str | None
    delay: int
    valve_names: tuple[str, ...]
    valves: list[np.void]
    faults: Faults | None
    asked_from: int

    @abstractmethod
    def seen(self, row: Sequence[Any] | None = None) -> tuple[list[Any], list[Any]]:
        """Return what the controller's newest sample carries."""

    @property
    @abstractmethod
    def gear(self) -> int:
        """Number of the gear that was ordered last from the controller."""

    @property
    @abstractmethod
    def shifting(self) -> bool:
        """True while a profile of the controller runs."""

    def take_no_command(self, config: RigConfig) -> None:
        """Begin without a command; ``config`` tells the controller's outputs and to which valves they are wired."""
        outputs = config.structure.outputs
        self._setpoint, self._gear, self._shifting, self._flags = np.zeros(outputs), 0, False, 0
        self._silent, self._trouble = False, ""  # tripped for the age of the commands; what is known of why none comes
        self._duty, self._wiring = np.zeros(outputs), list(config.wiring)
        self._nothing = (0.0,) * outputs  # a command that asks for no output
        self._to_come: deque[tuple] = deque()  # commands that do not act yet: boundary, function, values, sample
        self._last_command = -1  # sample that the newest valid command from outside answers
        self._arrived = -1  # that of the newest to arrive; first that of the first one, so that an age counts where none arrives
        # rows on their way to a plugged controller, each with the sample at which it is there, and the one that it has
        self._under_way: Sequence[tuple[int, list[float]]] = ()
        self._arrived_row: list[float] = []
        ranges = {one.name: (one.low, one.high) for one in config.structure.transducers}
        self._ranges = [ranges.get(name, (0.0, 0.0)) for name in self.channels]
        self._held_open = False  # True after a reset: no command acts until the controller has been in neutral
        self.idle_command = ""
        self._ordered: int | None = None  # gear that the embedded controller takes at its next sample
        self.ask_anew()

    def ask_anew(self) -> None:
        """Give a controller outside, from the present sample on, the time that a silent one has for its first answer."""
        self.asked_from = self.sample

    def handed(self, wants: Sequence[str]) -> tuple[list[float], list[float], list[float]]:
        """Return what a plugged controller is given at the present sample, as faults let it come; called once for each sample.

        Parameters
        ----------
        wants : sequence of str
            Transducers that it receives in addition to those of its record.

        Returns
        -------
        currents : (outputs,) list of float
            Measured coil current at each output of the controller [A].
        measured : (transducers,) list of float
            Values of the controller's transducers in the order of its record [SI].
        others : (wants,) list of float
            Values of the additional ones [SI].
        """
        row = self.row().tolist()
        if self.faults is not None:
            row = self._told(row)
        return *self.seen(row), [row[self.channels.index(name)] for name in wants]

    def _told(self, row: list[float]) -> list[float]:
        """Return the row that a controller has when this one is sent to it: the newest that is there, the very first at once."""
        way, now = self._under_way, self.sample
        for boundary, values in self.faults.lines[MEASUREMENTS].carried(now, now, row, self._ranges):
            way = (*way, (max(boundary, way[-1][0]) if way else boundary, values))  # none overtakes another
        there = [values for boundary, values in way if boundary <= now]
        self._under_way, self._arrived_row = way[len(there) :], there[-1] if there else self._arrived_row or row
        return self._arrived_row

    @property
    def output_names(self) -> str:
        """Names of the controller's outputs in their order, each with its valve."""
        valves = dict(zip(self._wiring, self.valve_names))
        return ", ".join(f"output_{k + 1}" + (f" ({valves[k]})" if k in valves else "") for k in range(len(self._nothing)))

    def profile(self, output: int) -> np.ndarray:
        """Return times [s] and currents [A] of the embedded controller's profile of an output (6, 2), which can be written."""
        return self._law_profiles[output]

    @property
    def newest_command(self) -> int:
        """The sample that the newest command answers; -1 before the first command and on a rig without a controller."""
        return self.sample - 1 if self.embedded else self._last_command

    @property
    def command_age(self) -> float:
        """Simulated time [s] since the sample that the newest command to arrive answers; 0 before the first command.

        A late command arrives when its delay is over. Where none arrives, the age counts from the first answered sample.
        """
        if self.embedded:
            newest = self.newest_command
        else:
            waiting = tuple(self._to_come)  # in one piece: another thread asks for the health of a rig that goes on
            arrived = (sample for boundary, _, _, sample, *_ in waiting if boundary - self.delay <= self.sample)
            newest = max([self._arrived, *arrived])
        return (self.sample - newest) * (SAMPLE_NS * 1e-9) if newest >= 0 else 0.0

    def _silence(self) -> str:
        return f"valve commands older than {COMMAND_TIMEOUT * 1e3:.0f} ms: {self._trouble or 'the shift controller is silent'}"

    def explain_silence(self, trouble: str) -> bool:
        """Take what the controller's plug knows of why no answer comes, as the reason of a trip for the age of the commands.

        Parameters
        ----------
        trouble : str
            The sentence; it counts until the next command.

        Returns
        -------
        bool
            True when the rig has tripped for that age already; its reason is then changed.
        """
        self._trouble, late = trouble, self._silent and not self.stopped_by_person
        if late:
            self.reason = self._silence()
        return late

    def fail_controller(self, reason: str) -> bool:
        """Trip for a controller that cannot go on.

        Parameters
        ----------
        reason : str
            The plug's sentence.

        Returns
        -------
        bool
            True when the rig has tripped for the age of the commands already; its reason is then changed.
        """
        late, self._silent = self._silent and not self.stopped_by_person, False
        if late:
            self.reason, self.tripped_by = reason, BAD_CONTROLLER
        self.trip(reason, BAD_CONTROLLER)
        return late

    def _act_due(self) -> None:
        while self._to_come and self._to_come[0][0] <= self.sample:
            _, act, *values = self._to_come.popleft()
            act(*values)

    def set_command(
        self, level: int, sample: int, duty: Collection[float], setpoint: Collection[float], gear: int, shifting: bool, flags: int
    ) -> None:
        """Take the fields of a rig_msgs/ValveCommand, at the level that the command names.

        Parameters
        ----------
        level : int
            0 for duty, 1 for current.
        sample : int
            The controller sample that the command answers.
        duty : (outputs,) collection of float
            Duty of each output of the controller, 0 to 1; it acts at level 0.
        setpoint : (outputs,) collection of float
            Current setpoint of each output [A]; it acts at level 1.
        gear : int
            Number of the gear that the controller reports.
        shifting : bool
            True while the controller shifts.
        flags : int
            Bit k keeps output k on at a setpoint of zero; used at level 1.

        Raises
        ------
        RigError
            When the command is refused.
        """
        if level not in range(len(LEVELS)):
            raise RigError(f"valve command for sample {sample} refused: level {level} is neither 0 (duty) nor 1 (current)")
        if LEVELS[level] == "current":
            self.set_current(sample, setpoint, gear, shifting, flags)
        else:
            self.set_duty(sample, duty, setpoint, gear, shifting)

    def set_duty(self, sample: int, duty: Collection[float], setpoint: Collection[float], gear: int, shifting: bool) -> None:
        """Take an external controller's answer to a sample at level "duty".

        Parameters
        ----------
        sample : int
            The controller sample that is answered.
        duty : (outputs,) collection of float
            Duty of each output of the controller, 0 to 1.
        setpoint : (outputs,) collection of float
            Current setpoint of each output [A], for the record.
        gear : int
            Number of the gear that the controller reports.
        shifting : bool
            True while the controller shifts.

        Raises
        ------
        RigError
            When the command is refused.
        """
        values = self._answer("duty", sample, duty, setpoint)
        duty, setpoint = values[: len(self._duty)], values[len(self._duty) :]
        if not 0.0 <= min(duty) <= max(duty) <= 1.0:
            raise RigError(f"valve command for sample {sample} refused: duty must be 0 to 1, found {duty}")
        self._accept("duty", sample)
        self._duty[:], self._setpoint[:] = duty, setpoint
        self._gear, self._shifting = int(gear), bool(shifting)
        self._send(sample, self._act_duty, duty if self._may_act("duty", values) else self._nothing, 1.0)
        self._act_due()

    def _act_duty(self, duty: list[float], sample: int) -> None:
        self._arrived = max(self._arrived, sample)
        for valve, output in zip(self.valves, self._wiring):
            valve["pending"] = duty[output]

    def set_current(self, sample: int, setpoint: Collection[float], gear: int, shifting: bool, flags: int = 0) -> None:
        """Take an external controller's answer to a sample at level "current".

        The power stage drives output k while its setpoint is above zero or bit k of ``flags`` is set, with the coil currents of
        the last sample. Its duty acts from the next boundary on, like that of :meth:`set_duty`.

        Parameters
        ----------
        sample : int
            The controller sample that is answered.
        setpoint : (outputs,) collection of float
            Current setpoint of each output of the controller [A].
        gear : int
            Number of the gear that the controller reports.
        shifting : bool
            True while the controller shifts.
        flags : int
            Bit k keeps output k on at a setpoint of zero.

        Raises
        ------
        RigError
            When the command is refused.
        """
        values = self._answer("current", sample, setpoint)
        limit = self.config.alfa46.values.current_limit
        if not all(0.0 <= i <= limit for i in values):
            raise RigError(f"valve command for sample {sample} refused: setpoints must be 0 to {limit:g} A, found {values}")
        self._accept("current", sample)
        self._setpoint[:] = values
        self._gear, self._shifting, self._flags = int(gear), bool(shifting), int(flags)
        current, held = (values, int(flags)) if self._may_act("current", values) else (self._nothing, 0)
        self._send(sample, self._act_current, current, limit, held)
        self._act_due()

    def _send(self, sample: int, act: Callable[..., None], values: Sequence[float], most: float, *more: int) -> None:
        """Have a command act at its boundary, or as faults of the messages let it arrive."""
        arrives = [(sample + self.delay, values)]
        if self.faults is not None:
            arrives = self.faults.lines[MESSAGES].carried(sample + self.delay, sample, values, [(0.0, most)] * len(values))
        if self._arrived < 0:
            self._arrived = int(sample)  # lost or late, too: the age counts from here
        if not arrives:
            return
        came = self._to_come
        copies = [came.pop()] if came and came[-1][0] == NEVER else []  # of the command before, which waits for this one
        (boundary, own), *again = arrives
        boundary = max(boundary, came[-1][0] if came else boundary)  # none overtakes another
        came.append((boundary, act, own, int(sample), *more))
        came.extend((boundary, *copy[1:]) for copy in copies)
        came.extend((later, act, one, int(sample), *more) for later, one in again)

    def _act_current(self, setpoint: list[float], sample: int, flags: int) -> None:
        self._arrived = max(self._arrived, sample)
        for k, value in enumerate(setpoint):
            self._law_outputs["setpoint"][k] = value
            self._law_outputs["phase"][k] = law.ON if value > 0.0 or flags >> k & 1 else law.OFF

    def _answer(self, level: str, sample: int, *vectors: Collection[float]) -> list[float]:
        """Return all numbers of an external controller's command in one list; RigError when the command cannot be taken."""
        if not self.shifts:
            raise RigError(f"'{self.config.name}' has no valves for a shift controller")
        if self.embedded:
            raise RigError(f"this rig runs its controller inside; {level} commands are for controller='external'")
        if self.level not in (None, level):
            raise RigError(
                f"valve command for sample {sample} refused: this run takes commands at level "
                f"'{self.level}', found one at level '{level}'; the level stays until its end"
            )
        if self.level is None:
            check_level(self.config, level)
        values = [float(value) for vector in vectors for value in vector]
        outputs = len(self._nothing)
        if {outputs} != set(map(len, vectors)) or not all(map(math.isfinite, values)):
            numbers = f"must be {outputs} finite numbers"
            what = f"duty and setpoint {numbers} each" if level == "duty" else f"the setpoint {numbers}"
            raise RigError(f"valve command for sample {sample} refused: {what}, one for each of {self.output_names}")
        if not self._last_command < sample <= self.sample:
            raise RigError(
                f"valve command for sample {sample} refused: expected one after {self._last_command} and not after {self.sample}"
            )
        return values

    def _accept(self, level: str, sample: int) -> None:
        """Record that a command was taken; the first one decides the level when none was given before."""
        self._last_command, self._trouble = int(sample), ""
        if self.level is None:
            self.level = level
            self._by = BY_SETPOINT if level == "current" else BY_DUTY

    def _may_act(self, level: str, command: Sequence[float]) -> bool:
        """Return whether a command may act, and so whether the trips take what it reports as true.

        After a reset, none may before the controller was in neutral with its valves shut.
        The valves are shut when the command asks for no more than what leaves them shut. So a clutch that was clamped before the
        trip is not clamped again without a new order.
        """
        self.idle_command = ""
        tripped = self.safe
        if self._held_open or tripped:
            valves = [getattr(self.config, name) for name in self.valve_names]
            asks = (
                bool(self._gear)
                or self._shifting
                or any(
                    command[output] * (v.coil_voltage / v.coil_resistance if level == "duty" else 1.0) > v.cracking_current
                    for output, v in zip(self._wiring, valves)
                )
            )
            self._held_open = self._held_open and asks
            if asks:
                self.idle_command = (
                    f"the rig is in its safe state ({self.reason})"
                    if tripped
                    else "since the reset no command has asked for neutral and for nothing"
                )
        if not self._held_open:  # a gear whose coils the rig itself holds open is none
            self.watched.says(self._gear, self._shifting)
        return not self._held_open

    def order_gear(self, gear: int) -> None:
        """Order a gear from the embedded controller, which takes the order at its next sample; RigError when it is refused."""
        if not self.shifts:
            raise RigError(f"'{self.config.name}' has no gears to order")
        if not self.embedded:
            raise RigError("this rig's controller is outside; order the gear there")
        why = refusal(
            gear,
            self.gear if self._ordered is None else self._ordered,
            self.shifting or self._ordered is not None,
            self.config.transmission,
        )
        if why:
            raise RigError(f"shift refused: {why}")
        self._ordered = gear
