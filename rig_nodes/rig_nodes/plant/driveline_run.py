# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs a driveline alone, with torques and capacities given over time.

For tests, examples and drive trains without hydraulics; the rig itself calls the kernel directly.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from rig_nodes.errors import RigError
from rig_nodes.plant import driveline_algebra as algebra
from rig_nodes.plant.driveline import System
from rig_nodes.plant.driveline_kernel import driveline_step

EVENT_NAMES = {algebra.LOCK: "lock", algebra.BREAK: "break", algebra.CROSS: "cross",
               algebra.FREE: "free", algebra.CLOSE: "close"}


class Event(NamedTuple):
    """Something a friction element did: time in s, its name, kind ("lock", "break", "cross", ...)."""

    t: float
    element: str
    kind: str


@dataclass(frozen=True)
class Result:
    """What `run` gives: r rows, one per step end and one for the start.

    t (r,) s; speeds (r, b) rad/s of the bodies; modes (r, m); torques (r, m) friction torque, Nm;
    shaft_torques (r, s) Nm; stored (r,), e_in (r,), e_fric (r, m), e_visc (r, m), e_shaft (r, s): energy
    stored, work of the external torques and losses since the start, J; impulse (r, m) Nm s.
    `capped` counts steps whose bound on events was reached. `speed`, `torque`, `mode` pick by name.
    """

    system: System
    t: np.ndarray
    speeds: np.ndarray
    modes: np.ndarray
    torques: np.ndarray
    shaft_torques: np.ndarray
    stored: np.ndarray
    e_in: np.ndarray
    e_fric: np.ndarray
    e_visc: np.ndarray
    e_shaft: np.ndarray
    impulse: np.ndarray
    events: list[Event]
    capped: int

    def speed(self, body: str) -> np.ndarray:
        return self.speeds[:, self.system.bodies.index(body)]

    def torque(self, element: str) -> np.ndarray:
        return self.torques[:, self.system.elements.index(element)]

    def mode(self, element: str) -> np.ndarray:
        return self.modes[:, self.system.elements.index(element)]

    def residual(self) -> np.ndarray:
        """Work in - change of stored energy - losses, J, for every row: rounding only."""
        losses = self.e_fric.sum(axis=1) + self.e_visc.sum(axis=1) + self.e_shaft.sum(axis=1)
        return self.e_in - (self.stored - self.stored[0]) - losses


@njit(cache=True, error_model="numpy", nogil=True)
def _run_steps(t, minv, w, sh, kc, q, cap, loss, v, twist, mode, el, shaft, e_in, events, count, work,
               out_v, out_twist, out_mode, out_el, out_shaft, out_e_in):
    for i in range(q.shape[0]):
        driveline_step(t[i + 1] - t[i], t[i], minv, w, sh, kc, q[i], cap[i], loss, v, twist, mode, el, shaft,
                       e_in, events, count, work)
        out_v[i + 1] = v
        out_twist[i + 1] = twist
        out_mode[i + 1] = mode
        out_el[i + 1] = el
        out_shaft[i + 1] = shaft
        out_e_in[i + 1] = e_in


Signal = float | Callable[[float], float] | tuple[Sequence[float], Sequence[float]]


def _ends(signal, name, t, jumps, step):
    """Right limits at the start and left limits at the end of every step, (len(t) - 1, 2)."""
    out = np.empty((len(t) - 1, 2))
    if callable(signal):
        near = 1e-9 * step
        at = np.array([float(signal(x)) for x in t])
        out[:, 0], out[:, 1] = at[:-1], at[1:]
        for i in np.flatnonzero(np.isin(t, jumps)):
            if i < len(t) - 1:
                out[i, 0] = float(signal(t[i] + near))
            if i > 0:
                out[i - 1, 1] = float(signal(t[i] - near))
    elif isinstance(signal, tuple):
        times, values = np.asarray(signal[0], float), np.asarray(signal[1], float)
        if times.ndim != 1 or times.shape != values.shape or len(times) == 0 or np.any(np.diff(times) < 0.0):
            raise RigError(f"driveline: the table for '{name}' needs as many values as times, "
                           "times not falling")
        out[:, 0], out[:, 1] = np.interp(t[:-1], times, values), np.interp(t[1:], times, values)
        for x in times[1:][np.diff(times) == 0.0]:
            i = int(np.argmin(np.abs(t - x)))
            if i < len(t) - 1:
                out[i, 0] = values[np.searchsorted(times, x, side="right") - 1]
            if i > 0:
                out[i - 1, 1] = values[np.searchsorted(times, x, side="left")]
    else:
        out[:] = float(signal)
    if not np.all(np.isfinite(out)):
        raise RigError(f"driveline: the input '{name}' is not finite at some time; finite numbers are needed")
    return out


def _grid(t_end, step, jumps):
    count = max(1, round(t_end / step))
    if abs(count * step - t_end) > 1e-6 * step:
        count = math.ceil(t_end / step)
    t = np.minimum(np.arange(count + 1) * step, t_end)
    t[-1] = t_end
    for x in jumps:
        i = int(np.argmin(np.abs(t - x)))
        if abs(t[i] - x) <= 1e-6 * step:
            t[i] = x
        else:
            t = np.insert(t, np.searchsorted(t, x), x)
    return t


def run(system: System, t_end: float, step: float, inputs: Mapping[str, Signal] | None = None,
        breakpoints: Sequence[float] = (), max_events: int = 10000) -> Result:
    """Run a driveline from t = 0 to t_end (s) in steps of `step` (s).

    inputs: by body name the torque on it (Nm), by clutch or brake name its kinetic torque (Nm, >= 0);
    each a number, a function of time, or a table (times, values), linear between its points, with a time
    named twice where it jumps. Times at which functions jump or bend go into `breakpoints`; steps end
    there. What has no input is without torque or open. Raises RigError for unknown names, negative
    capacities, values that are not finite, and steps that are not positive.
    """
    inputs = dict(inputs or {})
    if not (math.isfinite(step) and math.isfinite(t_end) and step > 0.0 and t_end > 0.0):
        raise RigError(f"driveline: step {step} and end time {t_end} must both be finite and above 0")
    free = [name for f, name in enumerate(system.elements) if not system.one_way[f]]
    for name in inputs:
        if name not in system.bodies and name not in free:
            raise RigError(f"driveline: there is no input '{name}'; inputs are: "
                           + ", ".join([*system.bodies, *free]))
    jumps = {float(x) for x in breakpoints}
    for signal in inputs.values():
        if isinstance(signal, tuple):
            jumps |= {float(x) for x in signal[0]}
    jumps = sorted(x for x in jumps if 0.0 <= x <= t_end)
    t = _grid(float(t_end), float(step), jumps)
    steps = len(t) - 1
    q = np.zeros((steps, 2, len(system.speeds)))
    cap = np.repeat(system.limits()[None], steps, axis=0)
    for name, signal in inputs.items():
        ends = _ends(signal, name, t, np.array(jumps), step)
        if name in system.bodies:
            q += ends[:, :, None] * system.bodies_from_speeds[system.bodies.index(name)]
            continue
        if np.any(ends < 0.0):
            raise RigError(f"driveline: the capacity of '{name}' falls to {ends.min():g} Nm; "
                           "it must be at least 0")
        f = system.elements.index(name)
        for k in (0, 1):
            cap[:, algebra.KIN0 + k, f] = ends[:, k]
            cap[:, algebra.HI0 + k, f] = system.stick[f] * ends[:, k]
            cap[:, algebra.LO0 + k, f] = -system.stick[f] * ends[:, k]
    x = system.state(max_events)
    out = [np.zeros((steps + 1, *a.shape), a.dtype) for a in (x.v, x.twist, x.mode, x.el, x.shaft, x.e_in)]
    for a, start in zip(out, (x.v, x.twist, x.mode, x.el, x.shaft, x.e_in)):
        a[0] = start
    _run_steps(t, system.minv, system.w, system.sh, system.kc, q, cap, x.loss, x.v, x.twist, x.mode, x.el,
               x.shaft, x.e_in, x.events, x.count, x.work, *out)
    v, twist, mode, el, shaft, e_in = out
    if x.count[algebra.N_EVENTS] > max_events:
        raise RigError(f"driveline: {x.count[algebra.N_EVENTS]} events in the run; "
                       f"max_events is {max_events}")
    events = [Event(float(a[0]), system.elements[int(a[1])], EVENT_NAMES[int(a[2])])
              for a in x.events[:x.count[algebra.N_EVENTS]]]
    stored = 0.5 * (np.einsum("ri,ij,rj->r", v, system.mass, v) + twist**2 @ system.kc[0])
    return Result(system, t, v @ system.bodies_from_speeds.T, mode, el[:, algebra.LAM], shaft[:, algebra.TAU],
                  stored, e_in.sum(axis=1), el[:, algebra.E_FRIC], el[:, algebra.E_VISC],
                  shaft[:, algebra.E_SHAFT], el[:, algebra.IMPULSE], events, int(x.count[algebra.N_CAPPED]))
