# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The interface that every plugged controller shows to the bench and to the alfa46 process, and what all plugs share.

A plug takes orders, answers samples and reports its gear; load.py makes one from a specification.
"""

from __future__ import annotations

import logging
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple, NoReturn

import numpy as np

from ..base import RigError, unknown
from ..plant import NEUTRAL
from ..rig import OUTPUT_KEYS, Alfa46Config
from .alfa46.box import Alfa46, refusal
from .ignored import Ignored
from .record import controller_info, record_of
from .seam import LEVELS, ControllerFailed, ControllerInputs, ControllerOutputs, Status, error_text, shortened, taken

if TYPE_CHECKING:
    from ..rig import RigConfig

LOG = logging.getLogger("rig_nodes.controllers")
LOG.addHandler(logging.NullHandler())  # tracebacks go to a run's logs; a verb without one shows the sentence only
STEP_TIMEOUT = 5.0  # s of wall clock for one sample when simulated time waits
SETTLE = 1.0  # s of wall clock in which the right controller may still come after one that cannot be used


class Answer(NamedTuple):
    """The answer to a sample: command (outputs,) as duty, or as setpoint [A] at level current; setpoint (outputs,) [A]."""

    command: tuple[float, ...]
    setpoint: tuple[float, ...]


def chosen_level(wanted: str | None, levels: tuple[str, ...], name: str) -> str:
    """Return the level to run at: the one asked for, else the controller's first.

    Parameters
    ----------
    wanted : str or None
        The level asked for; None leaves the choice to the controller.
    levels : tuple of str
        The levels at which the controller works, the preferred one first.
    name : str
        The controller's name, for the error's sentence.

    Returns
    -------
    str
        The level.

    Raises
    ------
    RigError
        When the controller does not work at the level asked for.
    """
    if wanted is None:
        return levels[0]
    if wanted not in levels:
        raise RigError(f"controller {name} works at level {' and '.join(levels)}, not at level '{wanted}'")
    return wanted


class NotUsed(RigError):
    """The only controller that has come cannot be used; the message has the reason."""

    exit_code = 1


class Waiting:
    """Reports to people that the rig waits for something: after 1, 2, 5 and 10 s and then every 10 s.

    Parameters
    ----------
    what : str
        What the rig waits for; each report begins with it.
    say : callable
        Takes each report as a str.
    """

    def __init__(self, what: str, say: Callable[[str], None]) -> None:
        self._what, self._say, self._began, self._next = what, say, time.monotonic(), 1.0

    @property
    def seconds(self) -> float:
        """Time since the wait began [s of wall clock]."""
        return time.monotonic() - self._began

    def report(self) -> None:
        """Report the wait when the next report is due."""
        if self.seconds >= self._next:
            self._say(f"{self._what}, {self.seconds:.0f} s")
            self._next = {1.0: 2.0, 2.0: 5.0}.get(self._next, 10.0 * (self.seconds // 10.0 + 1.0))


# where a controller's level comes from
GIVEN, DECLARED, DEFAULT = "as given", "as the controller declares", "by default, the controller declares none"
RECEIVED = "by default; a controller of the other level has no effect"


class Plug(ABC):
    """A controller behind the seam; subclasses define ``_answer(inputs)`` and, where something has to be ended, ``_end``.

    ``gear``, ``shifting`` and ``flags`` are those of the newest answer. ``_answer`` may take ``step_timeout`` s of wall
    clock (None: no limit); a controller that takes longer is ended by :meth:`_overdue`.

    Parameters
    ----------
    name : str
        The controller's name, for people.
    config : RigConfig
        The rig's configuration.
    level : str
        "duty" or "current": the meaning of the commands.
    """

    level_from = DEFAULT  # where the level comes from; each plug class sets what holds when no level was asked for
    in_process = False  # True: user code runs in this process, which cannot go on until that code returns
    own_clock = False  # True: the rig does not wait for the controller, which answers by its own clock
    step_timeout: float | None = STEP_TIMEOUT
    real_time = False
    wants: tuple[str, ...] = ()  # transducers that it receives in ``others`` in addition to the common ones
    settings: Mapping[str, float] = MappingProxyType({})  # its own settings, which can be set while it runs: value by name
    named_later = False  # True: wants, settings and signals become known when it comes; then ``named`` is called
    signals: Mapping[str, str] = MappingProxyType({})  # its own signals, which are recorded: unit by name
    signal_values: tuple[float, ...] = ()  # values of ``signals`` in the newest answer
    end_fault = ""  # what went wrong when the controller was ended in order
    abandoned = False  # True: a fatal fault came before that, and it was not ended in order
    trouble = ""  # what is known of why the newest sample has no answer; empty when it has one

    def __init__(self, name: str, config: RigConfig, level: str) -> None:
        self.name, self.level = name, level
        self.rig_record, self.transmission = record_of(config), config.transmission
        self.info = controller_info(self.rig_record, config.alfa46, level)
        self._inputs = self.rig_record.inputs
        self.gear, self.shifting, self.flags = 0, False, 0
        self.say: Callable[[str], None] = LOG.info  # reports to people what the plug waits for, and which controllers came and went
        self.named: Callable[[], None] = lambda: None
        self.stopped: Callable[[], bool] = lambda: False  # True: the run is being ended, the plug waits for nothing any more
        self.failing: Callable[[ControllerFailed], None] = lambda failure: None  # learns it before the end, which may take seconds
        self.refused = ""  # why the controller that came last is not used
        self.ignored = Ignored(name, lambda text: self.say(text))
        self._request, self._ordered, self._before = 0, False, 0
        self._doubted = False  # the warning that its duty looks like a current was given
        self._over = False  # the controller has failed or is closed and is not called again

    def pace(self, step_timeout: float | None, real_time: bool = False) -> None:
        """Set how long a step may take and whether simulated time waits for it.

        Parameters
        ----------
        step_timeout : float or None
            Longest time for a step [s of wall clock]; None sets no limit.
        real_time : bool
            True in real time, where simulated time does not wait.
        """
        self.step_timeout, self.real_time = step_timeout, real_time

    def wait(self, patience: float | None = None) -> None:
        """Wait until a controller that is a program of its own has come, and report the wait through ``say``.

        It returns early when the run is ended. In real time it is not called: samples without a controller are discarded until
        one comes.

        Parameters
        ----------
        patience : float or None
            Longest wait [s of wall clock]; None sets no limit.

        Raises
        ------
        RigError
            When no controller has come within ``patience``.
        NotUsed
            Sooner than that, when the only controller that came cannot be used.
        """

    @property
    def process_id(self) -> int | None:
        """Number of a process that works for the plug; None when there is none."""
        return None

    def _outputs_in(
        self, numbers: Sequence[float], gear: int, shifting: bool, flags: int, status: Status, text: str
    ) -> ControllerOutputs:
        """Return an answer whose numbers are commands, setpoints and the controller's signals, one after the other."""
        count = len(self.info.outputs)
        own = dict(zip(self.signals, numbers[2 * count :]))
        return ControllerOutputs(numbers[:count], numbers[count : 2 * count], gear, shifting, flags, status, text, own)

    def record(self) -> dict:
        """Return the report's entry on the controller, once the controller has ended."""
        return {
            "name": self.name,
            "level": self.level,
            "level_from": self.level_from,
            **({"end_fault": self.end_fault} if self.end_fault else {}),
            **({"ignored": dict(self.ignored.counts)} if self.ignored.counts else {}),
        }

    def awaited(self) -> str:
        """Return a sentence that no usable controller has come to this run, and where; empty when one has or none is needed."""
        return ""

    def not_here(self, place: str, advice: str) -> str:
        """Return the sentence of :meth:`awaited` for as long as no usable controller has come to the place.

        Parameters
        ----------
        place : str
            Where the controller is expected, in words.
        advice : str
            What the person can do, in words.

        Returns
        -------
        str
            The sentence; when a controller was refused, it contains the reason.
        """
        if self.refused:
            return f"one has come on {place} and is not used: {self.refused}"
        return f"no controller has come on {place}; {advice}"

    def _in_vain(self, waiting: Waiting, patience: float | None, none_came: str, advice: str) -> RigError | None:
        """Return the error that ends the wait, None as long as there is none; ``none_came`` and ``advice`` enclose the time."""
        if patience is None:
            return None
        if self.refused and waiting.seconds > min(SETTLE, patience):
            return NotUsed(f"controller {self.name}: one has come and is not used: {self.refused}")
        if waiting.seconds > patience:
            return RigError(f"controller {self.name}: {none_came} within {patience:g} s{advice}")
        return None

    def order(self, gear: int) -> None:
        """Request a gear, which the controller sees with the next sample.

        Parameters
        ----------
        gear : int
            Number of the gear.

        Raises
        ------
        RigError
            When the order is refused; the sentence has the reason.
        """
        why = refusal(gear, self._request if self._ordered else self.gear, self.shifting or self._ordered, self.transmission)
        if why:
            raise RigError(f"shift refused: {why}")
        self._before, self._request, self._ordered = self._request, gear, True

    def withdraw(self) -> bool:
        """Take back an order that no sample has brought to the controller yet; return False when there is none."""
        if not self._ordered:
            return False
        self._request, self._ordered = self._before, False
        return True

    def force_neutral(self) -> None:
        """Take back all orders after a trip; from its next sample on the controller's gear request is neutral."""
        self._before = self._request = NEUTRAL
        self._ordered = True

    def notice(self, reason: str) -> None:
        """Take why the rig is in its safe state, empty when it is not; a plug whose wire has a message for it sends that."""

    def step(self, sample: int, current: Iterable[float], measured: Iterable[float], others: Iterable[float] = ()) -> Answer | None:
        """Give the controller one sample and return its answer.

        Parameters
        ----------
        sample : int
            Index of the sample since time 0.
        current : (outputs,) iterable of float
            Measured coil currents [A].
        measured : iterable of float
            Values of the transducers in the rig's record, in its order [SI].
        others : iterable of float
            Values of ``wants``, in its order [SI].

        Returns
        -------
        Answer or None
            None when the controller discards the sample.

        Raises
        ------
        ControllerFailed
            When the controller reports an error, breaks down or returns what no valve can be given. Its sentence is a reason
            to trip.
        """
        if self._over:
            raise ControllerFailed(f"controller {self.name} has ended and cannot be asked again", Status.FATAL)
        inputs = self._inputs(
            sample,
            sample * self.info.period,
            self._request,
            tuple(map(float, current)),
            tuple(map(float, measured)),
            dict(zip(self.wants, others, strict=True)),
            self.settings,
        )
        self._ordered = False
        try:
            outputs = self._answer(inputs)
        except ControllerFailed:
            raise
        except Exception as error:  # an unforeseen fault of the plug, or of the program that it connects to
            LOG.error("controller %s, sample %d", self.name, sample, exc_info=True)
            self._fail(Status.FATAL, sample, f"the plug could not get its answer: {error_text(error)}")
        try:
            answer = taken(outputs, self.info, self.signals)
        except RigError as error:
            self._fail(Status.ERROR, sample, str(error))
        except Exception as error:  # a user's attribute may raise anything
            LOG.error("controller %s, sample %d: its outputs cannot be read", self.name, sample, exc_info=True)
            self._fail(Status.ERROR, sample, f"its outputs cannot be read: {error_text(error)}")
        if answer.status == Status.OK:
            _, _, command, setpoint, self.gear, self.shifting, self.flags, self.signal_values = answer
            self.trouble = ""
            if not self._doubted and command == setpoint and self.level == "duty" and any(command):
                self._doubt(sample)
            self._count_signals()
            return Answer(command, setpoint)
        if answer.status != Status.DISCARD:
            self._fail(answer.status, sample, f"status {answer.status.name.lower()}: {answer.text}")
        self.trouble = f"controller {self.name} does not answer: {answer.text}"
        return None

    def _doubt(self, sample: int) -> None:
        """Warn of a duty that equals the controller's current setpoint [A]."""
        self._doubted = True
        self.say(
            f"warning: controller {self.name}, sample {sample}: its command equals its current setpoint, so it "
            f"looks like amperes, and level duty ({self.level_from}) takes it as a share of the supply; if it is a "
            "current, choose --level current"
        )

    def _count_signals(self) -> None:
        """Count values of its own signals that are no finite numbers: they stay, because a signal may have no value at times."""
        for name, value in zip(self.signals, self.signal_values, strict=True):
            if not math.isfinite(value):
                self.ignored.add(
                    f"a value of its signal {name} is no finite number",
                    f"controller {self.name}: its signal {name} is {value:g}; it is recorded as it is, as are others like it",
                )

    def check_value(self, name: str, value: float) -> None:
        """Check that the controller has a setting of its own with this name, and that it can take the value.

        Parameters
        ----------
        name : str
            The setting's name.
        value : float
            The new value.

        Raises
        ------
        RigError
            When there is no such setting or the value is not finite.
        """
        if name not in self.settings:
            raise RigError(f"controller {self.name}: {unknown('setting of its own', name, self.settings)}")
        if not math.isfinite(value):
            raise RigError(f"setting '{name}' of controller {self.name} is {value}, expected a finite number")

    def set_value(self, name: str, value: float) -> None:
        """Change one of the controller's own settings from the next sample on; RigError as in :meth:`check_value`."""
        self.check_value(name, value)
        self.settings = {**self.settings, name: float(value)}

    def check_change(self, config: Alfa46Config) -> None:
        """Check that new alfa46 settings can be taken while the controller runs.

        Parameters
        ----------
        config : Alfa46Config
            The new settings.

        Raises
        ------
        RigError
            When they cannot be taken; the sentence has the reason.
        """
        raise RigError(
            f"controller {self.name} reads its settings when it starts; only the built-in alfa46 takes new ones while it runs"
        )

    def change(self, config: Alfa46Config) -> None:
        """Use these settings, which were checked before, from the next sample on."""
        self.check_change(config)

    def close(self) -> None:
        """End the controller once; further calls, also after a failure, do nothing. ``end_fault`` holds what went wrong."""
        if not self._over:
            self._over = True
            self._finish(self._end)

    def _finish(self, end: Callable[[], None]) -> None:
        """End the controller; a fault of the program or library behind the plug must not keep the run from its own end."""
        try:
            end()
        except Exception as error:
            LOG.error("controller %s: it cannot be ended in order", self.name, exc_info=True)
            self.end_fault = f"it cannot be ended in order: {error_text(error)}"
        self.ignored.conclude()

    def _fail(self, status: Status, sample: int, text: str) -> NoReturn:
        failure = ControllerFailed(f"controller {self.name}, sample {sample}: {shortened(text)}", status)
        self.failing(failure)
        if status == Status.FATAL:
            if not self._over:
                self._over = self.abandoned = True
                self._finish(self._abandon)
        else:
            self.close()
        raise failure

    def _overdue(self, sample: int) -> NoReturn:
        """Fail because no answer came within the time for a step."""
        option = "" if self.real_time else " (--step-timeout)"
        seconds = f"{self.step_timeout * 1e3:.0f} ms" if self.step_timeout < 1.0 else f"{self.step_timeout:g} s"
        self._fail(Status.FATAL, sample, f"no answer for {seconds}{option}")

    @abstractmethod
    def _answer(self, inputs: ControllerInputs) -> ControllerOutputs:
        """Return the controller's own answer to a sample, before the checks.

        Where there is none, a plug ends with :meth:`_fail` or :meth:`_overdue`, whose sentence trips the rig. Any other exception
        trips it, too, with a sentence that can only name the exception.
        """

    def _abandon(self) -> None:
        """Release what is outside this process after a fatal status, once, without a call into the controller."""

    def _end(self) -> None:
        """End the controller; a plug without anything to end leaves this empty."""


class BuiltIn(Plug):
    """The Alfa46 law as it is compiled for the kernel."""

    level_from = DECLARED

    def __init__(self, config: RigConfig, level: str | None = None) -> None:
        super().__init__("alfa46", config, chosen_level(level, LEVELS, "alfa46"))
        Alfa46.load(config.alfa46, config.transmission)
        self._box = Alfa46(config.alfa46, config.transmission)
        self._changed: Alfa46Config | None = None  # new settings; they take effect before the order of the same sample
        self._newest = config.alfa46

    def check_change(self, config: Alfa46Config) -> None:
        """Refuse changes of the profiles that a running or ordered shift moves; they stay as they are until its end."""
        moved = self._box.outputs_in_shift()
        if self._ordered:
            for gear in (self._request, self.gear):
                moved[list(self.transmission.outputs(gear))] = True
        for k, key in enumerate(OUTPUT_KEYS):
            if moved[k] and not np.array_equal(config.profiles[k], self._newest.profiles[k]):
                raise RigError(f"the profile of {key} is in use by a shift that is still running; wait for its end")

    def change(self, config: Alfa46Config) -> None:
        """Use settings that :meth:`check_change` has passed."""
        self._newest = self._changed = config

    def force_neutral(self) -> None:
        """Take back all orders; the law itself is in neutral at once."""
        self._box.force_neutral()
        self._before = self._request = self.gear = NEUTRAL
        self._ordered = self.shifting = False

    def _answer(self, inputs: ControllerInputs) -> ControllerOutputs:
        box = self._box
        changed, self._changed = self._changed, None
        if changed is not None:
            box.change(changed)
        if inputs.gear_request != box.gear:
            box.order(inputs.gear_request)
        duty, setpoint = box.step(inputs.sample, inputs.current)
        flags = sum(1 << k for k, active in enumerate(box.active) if active)
        command = duty if self.level == "duty" else setpoint
        return ControllerOutputs(command.tolist(), setpoint.tolist(), box.gear, box.shifting, flags)
