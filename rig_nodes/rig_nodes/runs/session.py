# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rig to step by hand: setpoints and orders, time, readings, and a state to which one can return.

It is what ``rig.session()`` returns; the learning environments stand on it. The rig is that of ``simulate``, bit for bit.
"""

from __future__ import annotations

import html
from contextlib import suppress
from dataclasses import dataclass, field
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import SAMPLE, TICK_SAMPLES, RigError, brief, dimension_of_text, quantity, shown_in, unknown
from ..controllers import LEVELS, Plug
from ..plant import relief_setting_for
from ..rig import CONTROLLER, CONTROLLER_EVENTS, OWN, SHIFT_ORDERED, WARNING
from .recorded import Listener, played, signals_of
from .rig import Rig
from .sequence import Sequence
from .simulation import LocalBench, advance_with, rig_for, runner_on

if TYPE_CHECKING:
    from collections.abc import Sequence as Values

    from ..rig import RigConfig
    from .snapshot import Snapshot

Event = tuple[float, str, str, float]
REPEATED = 50  # samples after which a command given by hand is given again, before its age would trip the rig
ORDER = "shift"  # key of an order in sequences


@dataclass(frozen=True)
class SessionSnapshot:
    """A moment of a session, which can be pickled.

    Parameters
    ----------
    time : float
        Simulated time [s].
    rig : Snapshot
        The state of the rig.
    command : tuple
        Level and values of the newest command given by hand, or None, and the gear that is reported with it.
    events : tuple
        The events until then.
    """

    time: float
    rig: Snapshot = field(repr=False)
    command: tuple = field(repr=False)
    events: tuple[Event, ...] = field(repr=False)


class Session:
    """A rig that is stepped by hand.

    Parameters
    ----------
    config : RigConfig
        The rig's configuration.
    seed : int
        Seed of the transducers' errors and noise.
    controller : str or Plug
        "embedded" for the Alfa46 inside the rig; "external" for commands by :meth:`set`, with "current" or "duty"; or a plugged
        controller (controllers.load_controller), which is closed with the session.
    level : str or None
        Level of the commands of "external": "current" or "duty"; None takes that of the first command.
    delay : int
        Samples after which a command of a controller that is not embedded acts.

    Attributes
    ----------
    rig : Rig
        The rig itself.
    events : list of (float, str, str, float)
        Time [s], name, text and value of each event: orders, changed settings, warnings, trips, faults, steps of sequences.

    Raises
    ------
    RigError
        When the controller does not fit the rig.

    Examples
    --------
    >>> from rig_nodes.rig import load_rig
    >>> from rig_nodes.runs import Session
    >>> with Session(load_rig("hydmag"), seed=1) as session:
    ...     session.set("oil", "4 MPa")
    ...     session.set("shift", "I")
    ...     session.advance(0.5)
    ...     start = session.snapshot()
    ...     session.set("motor", 100.0)
    ...     session.advance(2.0)
    ...     fast = session.read("n_wej")
    ...     session.restore(start)
    ...     (session.time, session.gear, 95.0 < fast < 105.0, abs(session.read("n_wej")) < 1.0)
    (0.5, 'I', True, True)
    """

    def __init__(
        self, config: RigConfig, seed: int = 1, controller: str | Plug = "embedded", level: str | None = None, delay: int = 1
    ) -> None:
        if isinstance(controller, Plug):
            self._plug, self.rig = controller, rig_for(config, seed, controller, delay)
        else:
            self._plug, self.rig = (
                None,
                Rig(config, seed, controller, level or "duty" if controller == "embedded" else level, delay=delay),
            )
        self._opened = self._plug
        self._command: tuple[str, tuple[float, ...]] | None = None
        self._gear = 0  # that a controller outside reports
        self.events: list[Event] = []
        self._listen([])

    def _listen(self, signals: list[str]) -> None:
        self._listener = Listener(self.rig, signals, None, self._plug)
        self._listener.events = self.events
        self._bench = LocalBench(self.rig, self._listener, self._plug)
        self._tripped = self.rig.safe

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End a plugged controller; a session without one needs no end."""
        if self._opened is not None:
            self._opened.close()

    # ---- time

    @property
    def time(self) -> float:
        """Simulated time since the start [s]."""
        return self.rig.time

    @property
    def status(self) -> str:
        """The rig's status: "starting", "ready", "running" or "tripped"."""
        return self.rig.status.name.lower()

    @property
    def reason(self) -> str:
        """Why the rig is tripped; empty when it is not."""
        return self.rig.reason

    def advance(self, dt: float | str) -> None:
        """Let time pass. A rig that trips goes on in its safe state, until :meth:`reset`.

        Parameters
        ----------
        dt : float or str
            Time [s] or a text with its unit, e.g. "10 ms"; a whole number of milliseconds.

        Raises
        ------
        RigError
            For any other time.
        """
        rig = self.rig
        end = rig.sample + rig.samples_in(quantity(dt, "time", "dt") if isinstance(dt, str) else _number(dt, "dt"))
        self._note_trip()
        while rig.sample < end:
            if self._plug is not None and not rig.safe:
                advance_with(rig, self._plug)
            elif self._command is None:
                rig.advance_samples(end - rig.sample)
            else:
                self._give(*self._command)
                rig.advance_samples(min(end - rig.sample, REPEATED))
            self._note_news()
            self._note_trip()

    def _note_news(self) -> None:
        """Keep what the rig has said since the last time: warnings of trips, beginnings and ends of faults."""
        news = [(stamp / 1e9, WARNING, sentence, value) for stamp, sentence, value in self.rig.warnings]
        self.rig.warnings.clear()
        if self.rig.faults is not None:
            news += [(one.sample * SAMPLE, one.name, one.text, one.value) for one in self.rig.faults.take_news()]
        self.events += sorted(news, key=itemgetter(0))

    def _note_trip(self) -> None:
        if self.rig.safe and not self._tripped:
            self._tripped = True
            self._listener.event("/rig/events", "rig_tripped", self.rig.reason)

    def play(self, sequence: Sequence, orders: int | None = None) -> None:
        """Move through a sequence, from the next tick of 5 ms on.

        Parameters
        ----------
        sequence : Sequence
            The sequence (runs.load_sequence).
        orders : int, optional
            Stop as soon as the sequence has given so many orders of a gear, the last of which the controller takes next; by default
            the whole sequence is played.

        Raises
        ------
        RigError
            When the sequence does not fit the rig.
        SequenceFailed
            When a step does not end in time.
        """
        if not isinstance(sequence, Sequence):
            raise RigError(f"play takes a sequence as rig_nodes.runs.load_sequence returns it, found {brief(sequence)}")
        self._listen(signals_of(sequence))
        listener = self._listener
        runner = runner_on(self.rig, listener, self.rig.config, sequence, self._plug)
        listener.advance(TICK_SAMPLES - self.rig.sample % TICK_SAMPLES)
        for _ in played(self.rig, listener, runner):
            self._note_news()
            if orders is not None and len(listener.orders) >= orders:
                return
        self._note_trip()

    def reset(self) -> None:
        """Leave the safe state after a trip, as ``rig reset`` does; RigError when the rig is not in it."""
        self.rig.reset()
        self._command, self._gear, self._tripped = None, 0, False
        self.rig.ask_anew()

    # ---- what is set

    def set(self, name: str, value: Any) -> None:
        """Give a setpoint, order a gear, change a setting, or command the valves; it acts at the next :meth:`advance`.

        Parameters
        ----------
        name : str
            Key of a device in sequences, e.g. "motor", "load" or "oil"; "shift" for an order of a gear; the name of a setting that
            can change in a run, e.g. "alfa46.t12"; or "current" or "duty" where the controller is outside.
        value : float, str, bool, None or sequence of float
            A number [SI] or a text with its unit, e.g. "1500 rpm". A load takes texts only, a torque ("80 Nm") or the pressure of
            its relief valve ("4 MPa"). None switches a device off. For "shift" the name of the gear; with the controller outside it
            is the gear that your controller reports. A setting of the Alfa46 acts from the next order on: a running shift keeps its
            profiles. For "current" and "duty" one number for each output of the controller [A] or 0 to 1, three of hydmag:
            output_1 (valve_zr_p1), output_2 (valve_zr_p2), output_3; they hold until the next ones.

        Raises
        ------
        RigError
            When the name is unknown or the rig refuses the value.
        """
        settings = self.rig.settings
        if not isinstance(name, str):
            raise RigError(f"name is {brief(name)}, expected that of a setpoint or setting")
        if name in settings.steps:
            self._set_device(name, value)
        elif name == ORDER:
            self._order(value)
        elif name in LEVELS:
            self._take_command(name, value)
        elif name.startswith(OWN):
            self._bench.change(f"{CONTROLLER}.{name}", _number(value, name))
        elif name in settings:
            number = settings[name].value_of(value, name) if isinstance(value, (str, bool)) else _number(value, name)
            self._bench.change(name, float(number))
        else:
            raise RigError(unknown("setpoint or setting", name, [*settings.steps, ORDER, *LEVELS, *settings]))

    def fault(self, name: str, **how: Any) -> None:
        """Order a fault, or the end of one; the rig was loaded with ``faults="on"``.

        Parameters
        ----------
        name : str
            Name of the fault, e.g. "motor.weak"; ``rig list faults`` prints those of a rig.
        **how
            ``size``, ``onset``, ``over``, ``period``, ``share``, ``at``, ``when`` as texts with units, as in a sequence's step
            ``fault``; ``lasts`` is its ``for``, and ``off=True`` ends the fault.

        Raises
        ------
        RigError
            When the rig refuses it, or faults are disabled.
        """
        if not isinstance(name, str):
            raise RigError(f"name is {brief(name)}, expected that of a fault")
        keys = {"lasts": "for"}
        given = [f"{keys.get(key, key)}={str(value).lower() if isinstance(value, bool) else value}" for key, value in how.items()]
        self.rig.order_fault(", ".join([name, *given]))
        self._note_news()

    def _set_device(self, step: str, value: float | str | None) -> None:
        rig, setting = self.rig, self.rig.settings.steps[step]
        if value is None:
            self._bench.set(step, 0.0, False)
            return
        takes = dict.fromkeys(setting.setpoint.command.takes.values())
        if isinstance(value, str) and dimension_of_text(value) == "torque" and "torque" in takes:
            torque, load = quantity(value, "torque", step), getattr(rig.config, setting.setpoint.device)
            if torque < 0.0:
                raise RigError(f"{step} is {value}; expected a torque of 0 Nm or more, which acts against the motion")
            speed = rig.measurement(rig.config.structure.speed_of_load(setting.setpoint.device))
            value = relief_setting_for(torque, speed, load)
        elif isinstance(value, str):
            value = quantity(value, setting.dimension, step)
        else:
            value = _number(value, step)
            if len(takes) > 1:  # a bare number of Nm would be a few Pa
                ways = " or ".join(f"'{value:g} {shown_in(one)[0]}'" for one in takes)
                raise RigError(f"{step} is {value:g} without a unit, and it takes a {' or a '.join(takes)}; write {ways}")
        self._bench.set(step, value, True)

    def _order(self, gear: object) -> None:
        if not self.rig.shifts:
            raise RigError(f"'{self.rig.config.name}' has no gears to order")
        box = self.rig.config.transmission
        number = box.number(str(gear))
        if number is None:
            raise RigError(unknown("gear", str(gear), box.numbers))
        if self._plug is not None or self.rig.embedded:
            self._bench.order_gear(number)
        else:
            self._gear = number
            self._listener.event(CONTROLLER_EVENTS, SHIFT_ORDERED, f"shift to {box.names[number]} ordered", number)

    def _take_command(self, level: str, values: Values[float]) -> None:
        if self.rig.newest_command == self.rig.sample:
            raise RigError("the valves have a command for this millisecond already; advance before the next one")
        try:
            command = level, tuple(map(float, values))
        except (TypeError, ValueError):
            raise RigError(f"{level} is {brief(values)}; expected a number for each of {self.rig.output_names}") from None
        self._give(*command)
        self._command = command
        self._plug = self._listener.controller = None  # who commands by hand takes over from a plugged controller
        self.rig.plugged = False

    def _give(self, level: str, values: tuple[float, ...]) -> None:
        """Give the rig a command for this sample, where that was not done."""
        rig = self.rig
        if rig.newest_command == rig.sample:
            return
        if level == "current":
            rig.set_current(rig.sample, values, self._gear, False)
        else:
            rig.set_duty(rig.sample, values, (0.0,) * len(values), self._gear, False)

    # ---- what is read

    @property
    def gear(self) -> str:
        """Name of the gear that was ordered last."""
        return self.rig.config.transmission.names[self.rig.gear]

    @property
    def shifting(self) -> bool:
        """True while the controller shifts."""
        return self.rig.shifting

    @property
    def transducers(self) -> tuple[str, ...]:
        """Names of the rig's transducers, in the order of a row."""
        fitted = {one.name for one in self.rig.config.structure.transducers}
        return tuple(name for name in self.rig.channels if name in fitted)

    def read(self, name: str) -> float:
        """Return what a transducer shows now [SI], with its errors and noise; RigError for a name without a transducer."""
        return self.rig.measurement(name)

    def true(self, name: str) -> float:
        """Return the true value of a signal now [SI], which no controller sees.

        Parameters
        ----------
        name : str
            A transducer's name or a signal of the plant, e.g. "s1_slip"; ``rig list signals`` prints them.

        Returns
        -------
        float
            The value.

        Raises
        ------
        RigError
            When there is no such signal.
        """
        rig = self.rig
        if name in rig.channels:
            return rig.shown_truly(name)
        signals = rig.config.catalogue.signals
        if name not in signals:
            raise RigError(unknown("signal", name, signals))
        return self._listener.present(name)

    # ---- state

    def snapshot(self) -> SessionSnapshot:
        """Return this moment, for :meth:`restore`; it can be pickled.

        Raises
        ------
        RigError
            With a plugged controller, whose state is its own.
        """
        self._check_kept()
        self._note_news()
        self._note_trip()
        return SessionSnapshot(self.time, self.rig.snapshot(), (self._command, self._gear), tuple(self.events))

    def restore(self, snapshot: SessionSnapshot) -> None:
        """Return to a moment, of this session or of another one of the same configuration and seed.

        What follows is equal, bit for bit, to what followed then.

        Parameters
        ----------
        snapshot : SessionSnapshot
            A result of :meth:`snapshot`.

        Raises
        ------
        RigError
            When the snapshot is of another configuration, seed or version of rig_nodes, or with a plugged controller.
        """
        self._check_kept()
        if not isinstance(snapshot, SessionSnapshot):
            raise RigError(f"restore takes a result of snapshot(), found {brief(snapshot)}")
        self.rig.restore(snapshot.rig)
        self._command, self._gear = snapshot.command
        self.events[:] = snapshot.events
        self._listen([])

    def _check_kept(self) -> None:
        if self._plug is not None:
            raise RigError(
                f"the state of controller {self._plug.name} is its own, so a session with it has no snapshots; use the embedded "
                "Alfa46, or give the commands by set"
            )

    # ---- for people

    def _facts(self) -> list[str]:
        gear = [f"gear {self.gear}{', shifting' if self.shifting else ''}"] if self.rig.shifts else []
        return [f"seed {self.rig.seed}", f"{self.time:.3f} s", self.status, *gear]

    def __repr__(self) -> str:
        return f"<Session {self.rig.config.name}: {', '.join(self._facts())}>"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the state and the transducers in the units in which people read them."""
        catalogue, cells = self.rig.config.catalogue, []
        for name in self.transducers:
            signal = catalogue.signal(name)
            shown = f"{signal.shown(self.read(name)):.4g} {signal.display_unit}"
            cells.append(f"<tr><td>{html.escape(name)}</td><td>{html.escape(shown)}</td></tr>")
        head = html.escape(f"{self.rig.config.name}: {', '.join(self._facts())}")
        return f"<table><caption>{head}</caption>{''.join(cells)}</table>"


def _number(value: object, what: str) -> float:
    """Return a number of any numeric type; RigError for anything else."""
    with suppress(TypeError, ValueError):
        if not isinstance(value, bool | np.bool_):
            return float(value)
    raise RigError(f"{what} is {brief(value)}; expected a number in SI, or a text with its unit")
