# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs a driveline alone, with torques and capacities given over time or by a controller, and returns numpy arrays.

`run` runs it in one call, `Run` step by step as the user calls it; both give a `Result`. The rig itself calls the kernel
directly.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base import RigError, brief, njit
from rig_nodes.driveline import algebra
from rig_nodes.driveline.arrays import borrowed
from rig_nodes.driveline.calls import bare_address, bare_step
from rig_nodes.driveline.described import is_number
from rig_nodes.driveline.inputs import SAME, Input, Signal, step_ends
from rig_nodes.driveline.law_steps import LawRows, run_laws, settled_address
from rig_nodes.driveline.laws import (
    CAPACITY,
    GEARING,
    HEAT,
    MOTION,
    TORQUE,
    Given,
    LawState,
    Model,
    Moving,
    law_state,
    laws_of,
    stored_energy,
)
from rig_nodes.driveline.result import EVENT_NAMES, Event, Moment, Result
from rig_nodes.driveline.state import Loads, Rows, State, Structure, put_row
from rig_nodes.driveline.system import System, check_built, torque_refused

if TYPE_CHECKING:
    from rig_nodes.base import Floats, Ints

Controller = Callable[[Moment], Mapping[str, float] | None]


@njit(cache=True, error_model="numpy", nogil=True)
def _run_steps(bare: int, structure: Structure, loads: Loads, loss: Floats, state: State, t: Floats, h: Floats, rows: Rows) -> None:
    """Take a step of each length h from each time t and record the state after it; ``bare`` is an address."""
    structure, loads, loss, state, rows = borrowed(structure), borrowed(loads), borrowed(loss), borrowed(state), borrowed(rows)
    for i in range(loads.q.shape[0]):
        bare_step(bare, h[i], t[i], structure, Loads(loads.q[i], loads.cap[i]), loss, state)
        put_row(rows, i, state)


class Run:
    """A run of a driveline that can be stepped, stopped and continued; it begins at t = 0.

    A step ends at each point of a table, unless the points are as close as steps: then each step takes the mean of the table over
    it. A body without an input has no torque, and a clutch or brake without one is open. A copy (copy.deepcopy) continues
    independently.

    Parameters
    ----------
    system : System
        The driveline.
    step : float
        Length of a step [s].
    inputs : mapping of str to number, function or table, optional
        By the name of a body the torque on it [Nm]; by that of a clutch or brake its kinetic torque [Nm, >= 0]; by that of a
        torque or of a capacity of the description the factor on it; by that of a motion its speed [rad/s]. A value is a number,
        a function of time, or a table (times [s], values). A table is linear between its points and has a time twice where it
        jumps.
    breakpoints : sequence of float
        Times at which functions jump or bend [s]; steps end there.
    controller : Controller, optional
        Function that is called with a `Moment` at the start and after every `every` steps. The inputs that it returns, by name,
        hold until its next call.
    every : int
        Steps from one call of the controller to the next.
    max_events : int
        Largest number of events up to the next call of the controller or to the end of a call of `to`.

    Raises
    ------
    RigError
        For names that do not exist, negative capacities, values that are not finite, and steps that are not positive.
    """

    def __init__(
        self,
        system: System,
        step: float,
        inputs: Mapping[str, Signal] | None = None,
        *,
        breakpoints: Sequence[float] = (),
        controller: Controller | None = None,
        every: int = 1,
        max_events: int = 10000,
    ) -> None:
        check_built(system)
        if not (is_number(step) and math.isfinite(step) and step > 0.0):
            raise RigError(f"driveline: a step of {brief(step)} s; a finite number above 0 is needed")
        if not is_number(every) or every < 1 or every != int(every):
            raise RigError(f"driveline: the controller is called every {brief(every)} steps; a whole number from 1 on is needed")
        if inputs is not None and not isinstance(inputs, Mapping):
            raise RigError(f"driveline: inputs are {brief(inputs)}; a map from names to numbers, functions or tables is needed")
        if controller is not None and not callable(controller):
            raise RigError(f"driveline: the controller is {brief(controller)}; a function of the moment is needed")
        if is_number(breakpoints) or not all(is_number(x) and math.isfinite(x) for x in breakpoints):
            raise RigError(f"driveline: breakpoints are {brief(breakpoints)}; a list of finite times in s is needed")
        self.system, self.step_length = system, float(step)
        self._controller, self._every, self._max_events = controller, int(every), max_events
        self._state, self._loss = system.state(max_events, recorded=True), system.losses()
        self._laws, self._own = laws_of(system.laws, len(system.speeds)), law_state(system.laws)
        self._inputs: dict[str, Input] = {}
        self._breakpoints = np.unique(np.array([float(x) for x in breakpoints]))
        self._t, self._calls = 0.0, 0
        self._rows: list[tuple] = []
        self._events: list[np.ndarray] = []
        self.set(**(inputs or {}))

    @property
    def t(self) -> float:
        """Time that the run has reached [s]."""
        return self._t

    def set(self, **inputs: Signal) -> None:
        """Set inputs to other values or courses from the present time on.

        Parameters
        ----------
        inputs : number, function or table
            Inputs by name, as those of `Run`.

        Raises
        ------
        RigError
            When there is no such input or a value is not valid.
        """
        s = self.system
        taken = {number for mesh in s.meshes for number in (mesh.gear, mesh.brake)} | {*s.variators}
        loaded = [body for body in s.bodies if body not in s.balanced]
        known = [*loaded, *(name for f, name in enumerate(s.elements) if not s.one_way[f] and f not in taken), *s.factors]
        for name, signal in inputs.items():
            if name in s.balanced:
                raise torque_refused(name, "an input")
            if name not in known:
                raise RigError(f"driveline: there is no input '{name}'; inputs are: {', '.join(known)}")
            self._inputs[name] = Input(name, signal, self.step_length)
        self._points = np.unique(np.concatenate([self._breakpoints, *(one.points for one in self._inputs.values())]))

    def now(self) -> Moment:
        """Return the state that the run has reached."""
        s, x = self.system, self._state
        return Moment(
            s,
            self._t,
            s.bodies_from_speeds @ x.v,
            s.bodies_from_speeds @ x.twist[len(s.slots) :],
            s.w @ x.v * (1.0 - np.isin(np.arange(len(s.elements)), s.variators)),
            x.mode.copy(),
            x.el[algebra.LAM].copy(),
        )

    def step(self, count: int = 1) -> Moment:
        """Run on by `count` steps, to a whole multiple of the step.

        Parameters
        ----------
        count : int
            Number of steps.

        Returns
        -------
        Moment
            The state that is reached.
        """
        if not is_number(count) or count < 0 or count != int(count):
            raise RigError(f"driveline: {brief(count)} steps; a whole number from 0 on is needed")
        return self.to((math.floor(self._t / self.step_length + SAME) + count) * self.step_length)

    def to(self, t_end: float) -> Moment:
        """Run on to a time; a time that has been reached already changes nothing.

        Parameters
        ----------
        t_end : float
            The time [s].

        Returns
        -------
        Moment
            The state that is reached.

        Raises
        ------
        RigError
            When the time is not finite, an input is not valid, or there are more than `max_events` events.
        """
        if not (is_number(t_end) and math.isfinite(t_end)):
            raise RigError(f"driveline: end time {brief(t_end)} s; a finite number is needed")
        near = SAME * self.step_length
        while t_end - self._t > near:
            stop = t_end
            if self._controller is not None:
                call = self._calls * self._every * self.step_length
                if call - self._t <= near:
                    self._calls += 1
                    self.set(**(self._controller(self.now()) or {}))
                    call = self._calls * self._every * self.step_length
                stop = min(stop, call)
            self._advance(step_ends(self._t, stop, self.step_length, self._points))
        return self.now()

    def result(self) -> Result:
        """Return the result of everything since the start."""
        s = self.system
        if not self._rows:
            self._rows.append(self._first(np.zeros(2)))
        t, pushes, v, twist, mode, el, shaft, e_in, laws, law_angles, springs, work = map(np.concatenate, zip(*self._rows))
        events = np.concatenate([*self._events, np.zeros((0, 3 + 2 * len(s.speeds)))])
        angles, twist = twist[:, len(s.slots) :], twist[:, : len(s.shafts)]
        pushes = pushes + sum(laws[:, k, None] * law.bodies for k, law in enumerate(s.laws) if law.kind in (TORQUE, MOTION, HEAT))
        lost = shaft[:, algebra.E_SHAFT, : len(s.shafts)]
        # what states hold and conductors between them lose, and the work for that, belong to no balance of energy
        held = np.where(s.state_speeds, v, 0.0)
        apart = 0.5 * np.einsum("ri,ij,rj->r", held, s.mass, held) + lost[:, s.conductors].sum(axis=1)
        return Result(
            s,
            t,
            v @ s.bodies_from_speeds.T,
            angles @ s.bodies_from_speeds.T,
            v @ s.w.T * (1.0 - np.isin(np.arange(len(s.elements)), s.variators)),
            mode,
            el[:, algebra.LAM],
            twist,
            shaft[:, algebra.TAU, : len(s.shafts)],
            pushes,
            laws,
            law_angles,
            stored_energy(s, v, twist, laws, springs),
            e_in.sum(axis=1) + work[:, 0] - (apart - apart[0]),
            el[:, algebra.E_FRIC],
            el[:, algebra.E_VISC],
            lost * ~s.conductors,
            el[:, algebra.IMPULSE],
            [Event(float(a[0]), s.elements[int(a[1])], EVENT_NAMES[int(a[2])]) for a in events],
            events[:, 3 : 3 + len(s.speeds)] @ s.bodies_from_speeds.T,
            events[:, 3 + len(s.speeds) :] @ s.bodies_from_speeds.T,
            int(self._state.count[algebra.N_CAPPED]),
        )

    def _advance(self, t: Floats) -> None:
        x = self._state
        if not self._rows:
            self._rows.append(self._first(t))
        pushes, cap, given = self._given(t)
        x.count[algebra.N_EVENTS] = 0
        out = self._move(t, (pushes, cap, given), self._loss, x, self._own)
        count = int(x.count[algebra.N_EVENTS])
        if count > self._max_events:
            raise RigError(f"driveline: {count} events between {t[0]:g} and {t[-1]:g} s; max_events is {self._max_events}")
        self._rows.append((t[1:], pushes[:, 1], *out))
        self._events.append(x.events[:count].copy())
        self._t = float(t[-1])

    def _given(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Evaluate the inputs at both ends of the k steps between times t.

        They are the torques on the bodies (k, 2, b), `cap` (k, 7, m) of the kernel, and the inputs of the laws (k, 3, inputs),
        whose last row has the excess of a prescribed speed in the middle of the step over the mean of its ends.
        """
        s, steps = self.system, len(t) - 1
        pushes = np.zeros((steps, 2, len(s.bodies)))
        cap = np.repeat(s.limits()[None], steps, axis=0)
        given = np.zeros((steps, 3, len(s.factors)))
        moved = {law.name for law in s.laws if law.kind in (MOTION, GEARING)}
        for i, (name, default) in enumerate(s.factors.items()):
            given[:, :2, i] = default
            if name in self._inputs:
                given[:, :2, i] = self._inputs[name].ends(t, self._breakpoints)
                if name in moved:
                    given[:, 2, i] = self._inputs[name].middle(t) - given[:, :2, i].mean(axis=1)
        for name in {law.name for law in s.laws if law.kind == CAPACITY} - set(self._inputs):
            self._put(cap, s.elements.index(name), np.ones((steps, 2)))
        for name, one in self._inputs.items():
            if name in s.bodies:
                pushes[:, :, s.bodies.index(name)] = one.ends(t, self._breakpoints)
            elif name in s.elements and name not in moved:
                self._put(cap, s.elements.index(name), one.ends(t, self._breakpoints, 0.0))
        return pushes, cap, given

    def _put(self, cap: Floats, f: int, ends: Floats) -> None:
        for k in (0, 1):
            cap[:, algebra.KIN0 + k, f] = ends[:, k]
            cap[:, algebra.HI0 + k, f] = self.system.stick[0, f] * ends[:, k]
            cap[:, algebra.LO0 + k, f] = -self.system.stick[1, f] * ends[:, k]

    def _move(
        self, t: Floats, inputs: tuple[Floats, Floats, Floats], loss: Floats, x: State, own: LawState
    ) -> tuple[Floats | Ints, ...]:
        """Move losses, state and that of the laws through the steps between times t by what `_given` returns.

        The state and that of the laws at the end of each step are returned.
        """
        pushes, cap, given = inputs
        s, steps = self.system, len(t) - 1
        loads = Loads(np.ascontiguousarray(pushes @ s.bodies_from_speeds), cap)
        # all whole steps have the same length, so that the matrices of one serve the next
        h = np.diff(t)
        h[np.abs(h - self.step_length) <= SAME * self.step_length] = self.step_length
        rows = Rows(*(np.empty((steps, *a.shape), a.dtype) for a in (x.v, x.twist, x.mode, x.el, x.shaft, x.e_in)))
        law_rows = LawRows(*(np.zeros((steps, *a.shape)) for a in (own.torque, own.at, own.spring, own.work)))
        if s.laws or s.meshes:
            model = Model(bare_address(), s.structure, s.mass, self._laws)
            run_laws(settled_address(), model, Given(loads, given), Moving(loss, x, own), t, h, rows, law_rows)
        else:
            _run_steps(bare_address(), s.structure, loads, loss, x, t, h, rows)
        return *rows, *law_rows

    def _first(self, t: Floats) -> tuple[np.ndarray, ...]:
        """Return row 0, whose torques are those of a step of zero length."""
        s, begin = self.system, self.system.state(0, recorded=True)
        pushes, cap, given = self._given(t[:2])
        for row in (algebra.KIN0, algebra.LO0, algebra.HI0):
            cap[:, row + 1] = cap[:, row]
        for ends in (pushes, given):
            ends[:, 1] = ends[:, 0]
        given[:, 2] = 0.0
        _, _, mode, el, shaft, e_in, laws, law_angles, springs, work = self._move(
            t[0] + np.array([0.0, 1e-9 * self.step_length]),
            (pushes, cap, given),
            s.losses(),
            s.state(0, recorded=True),
            law_state(s.laws),
        )
        el[:, 1:], shaft[:, algebra.E_SHAFT] = 0.0, 0.0
        return (
            t[:1],
            pushes[:, 1],
            begin.v[None],
            begin.twist[None],
            mode,
            el,
            shaft,
            0.0 * e_in,
            laws,
            law_angles,
            0.0 * springs,
            0.0 * work,
        )


def run(
    system: System,
    t_end: float,
    step: float,
    inputs: Mapping[str, Signal] | None = None,
    breakpoints: Sequence[float] = (),
    max_events: int = 10000,
    *,
    controller: Controller | None = None,
    every: int = 1,
) -> Result:
    """Run a driveline from t = 0 to `t_end`.

    The other arguments and the errors are those of `Run`.

    Parameters
    ----------
    system : System
        The driveline.
    t_end : float
        End of the run [s], above 0.
    step : float
        Length of a step [s].

    Returns
    -------
    Result
        The course of the run.

    Raises
    ------
    RigError
        When the end time is not a finite number above 0, and as for `Run`.
    """
    if not (is_number(t_end) and math.isfinite(t_end) and t_end > 0.0):
        raise RigError(f"driveline: end time {brief(t_end)} s; a finite number above 0 is needed")
    one = Run(system, step, inputs, breakpoints=breakpoints, controller=controller, every=every, max_events=max_events)
    one.to(t_end)
    return one.result()
