# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bare problem of two_inertias in other tools, each with its best settings: cost against error of the lock-up time.

``rig bench peers`` uses it. A tool is a function that yields candidates (way, setting, call -> lock-up time [s]); models
are built before the call. All candidates are measured, and the cheapest one that is exact enough represents its tool, so
that each tool is shown at its best. docs/reference/performance.md describes the candidates.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from . import two_inertias as problem
from .machine import fastest, installed
from .two_inertias import CAPACITY, DRIVE, END, J1, J2, LOAD, RISE, W1

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import Context, ContinuousState, State, System, WitnessFunction

    from ...base import Floats

    Speeds = Sequence[float] | Floats

ERRORS = (1e-3, 1e-4, 1e-6)  # relative errors of the lock-up time
STOPS = 2000  # calls of a run that is stopped every 1 ms
Candidate = tuple[str, str, Callable[[], float]]


class Point(NamedTuple):
    """One measured candidate: relative error of the lock-up time, processor time of a run [s], and its real-time factor."""

    way: str
    setting: str
    error: float
    cpu_s: float
    real_time_factor: float


def ours() -> Iterator[Candidate]:
    """Yield our driveline, which finds the lock-up inside a step: equal steps, one step after the rise, or calls of 1 ms."""
    line = problem.Ours()
    for steps in (1, 2, 3, 5, 10, 20, 40, 80, 160):
        yield "free", f"{steps} steps and one", lambda steps=steps: line.run_straight(steps)
    for step in (5e-3, 1e-3, 1e-4, 1e-5):
        yield "free", f"step {step * 1e6:g} us", lambda step=step: line.run(step)
    for step in (1e-3, 1e-4):
        yield "stopped", f"step {step * 1e6:g} us", lambda step=step: line.run(step, STOPS)


_capacity, _sin = problem.capacity, math.sin  # found in one look-up, as the other tools find theirs


def _rising(t: float, v: Speeds) -> tuple[float, float]:
    """Return the accelerations of both inertias while the capacity rises [rad/s2]."""
    torque = CAPACITY * _sin(0.5 * math.pi * t / RISE)
    return (DRIVE - torque) / J1, (LOAD + torque) / J2


def _slipping(t: float, v: Speeds) -> tuple[float, float]:
    """Return the accelerations of both inertias while the clutch slips [rad/s2]."""
    torque = _capacity(t)
    return (DRIVE - torque) / J1, (LOAD + torque) / J2


def _locked(t: float, v: Speeds) -> tuple[float, float]:
    """Return the accelerations of both inertias when they are one [rad/s2]."""
    return ((DRIVE + LOAD) / (J1 + J2),) * 2


def by_scipy() -> Iterator[Candidate]:
    """Yield ode with a check at each step and solve_ivp with a terminal event; rise, slip and lock are separate systems."""
    yield from _by_ode()
    yield from _by_solve_ivp()


def _by_ode() -> Iterator[Candidate]:
    from scipy.integrate import ode

    def classic(method: str, tolerance: float) -> float:
        last = []

        def watch(t: float, v: Floats) -> int:
            last.append((t, v[0] - v[1]))
            return -1 if v[0] <= v[1] else 0

        first = ode(_rising).set_integrator(method, rtol=tolerance, atol=tolerance).set_initial_value((W1, 0.0), 0.0)
        second = ode(_slipping).set_integrator(method, rtol=tolerance, atol=tolerance)
        second.set_solout(watch)
        second.set_initial_value(first.integrate(RISE), RISE).integrate(END)
        # the rates are constant here: the straight line back to zero slip is exact
        (t0, s0), (t1, s1) = last[-2:]
        lock = t1 + (t1 - t0) * s1 / (s0 - s1)
        v = second.y - (second.t - lock) * np.array(_slipping(second.t, second.y))
        ode(_locked).set_integrator(method, rtol=tolerance, atol=tolerance).set_initial_value(v, lock).integrate(END)
        return lock

    def classic_stopped(method: str, tolerance: float) -> float:
        def system(rates: Callable[[float, Speeds], Speeds], v: Speeds, t: float) -> ode:
            return ode(rates).set_integrator(method, rtol=tolerance, atol=tolerance).set_initial_value(v, t)

        now, lock, rise = system(_rising, (W1, 0.0), 0.0), math.inf, round(RISE * STOPS / END)
        for k in range(1, STOPS + 1):
            v = now.integrate(k * END / STOPS)
            if k == rise:
                now = system(_slipping, v, now.t)
            elif math.isinf(lock) and v[0] <= v[1]:
                rates = np.array(_slipping(now.t, v))
                back = (v[0] - v[1]) / (rates[0] - rates[1])
                lock = now.t - back
                now = system(_locked, v - back * rates, lock)
                now.integrate(k * END / STOPS)
        return lock

    for method in ("dopri5", "dop853"):
        yield "stopped", f"ode {method}, 1e-03", lambda m=method: classic_stopped(m, 1e-3)
        for tolerance in (1e-2, 1e-4, 1e-6, 1e-9):
            yield "free", f"ode {method}, {tolerance:.0e}", lambda m=method, t=tolerance: classic(m, t)


def _by_solve_ivp() -> Iterator[Candidate]:
    from scipy.integrate import solve_ivp

    def slip(t: float, v: Speeds) -> float:
        return v[0] - v[1]

    slip.terminal, slip.direction = True, -1.0

    def free(method: str, tolerance: float) -> float:
        options = {"method": method, "rtol": tolerance, "atol": tolerance}
        part = solve_ivp(_rising, (0.0, RISE), (W1, 0.0), **options)
        part = solve_ivp(_slipping, (RISE, END), part.y[:, -1], events=slip, **options)
        lock = part.t[-1]
        solve_ivp(_locked, (lock, END), part.y[:, -1], **options)
        return lock

    def stopped(method: str, tolerance: float) -> float:
        options = {"method": method, "rtol": tolerance, "atol": tolerance}
        v, lock = (W1, 0.0), math.inf
        for k in range(STOPS):
            begin, end = k * END / STOPS, (k + 1) * END / STOPS
            if math.isinf(lock):
                part = solve_ivp(_rising if end <= RISE else _slipping, (begin, end), v, events=slip, **options)
                v = part.y[:, -1]
                if part.status != 1:
                    continue
                begin = lock = part.t[-1]
            v = solve_ivp(_locked, (begin, end), v, **options).y[:, -1]
        return lock

    for method in ("RK23", "RK45", "DOP853", "LSODA"):
        for tolerance in (1e-2, 1e-4, 1e-6, 1e-9):
            yield "free", f"{method}, {tolerance:.0e}", lambda m=method, t=tolerance: free(m, t)
    for method in ("RK23", "RK45"):
        yield "stopped", f"{method}, 1e-03", lambda m=method: stopped(m, 1e-3)


def by_pathsim() -> Iterator[Candidate]:
    """Yield one ODE block with a zero-crossing event; adaptive methods of three orders and fixed steps."""
    from pathsim import Simulation
    from pathsim.blocks import ODE
    from pathsim.events import ZeroCrossingDown
    from pathsim.solvers import RK4, RKBS32, RKCK54, RKDP87

    capacity = problem.capacity

    def run(solver: type, adaptive: bool, dt: float, tolerance: float) -> float:
        lock = []

        def rates(x: Floats, u: Floats, t: float) -> Floats:
            if lock:
                return np.array(((DRIVE + LOAD) / (J1 + J2),) * 2)
            torque = capacity(t)
            return np.array(((DRIVE - torque) / J1, (LOAD + torque) / J2))

        block = ODE(rates, np.array((W1, 0.0)))

        def slip(t: float) -> float:
            if lock:
                return 1.0
            v = block.engine.state
            return v[0] - v[1]

        event = ZeroCrossingDown(slip, lambda t: lock.append(t), tolerance=max(tolerance * W1, 1e-9))
        options = {"tolerance_lte_rel": tolerance, "tolerance_lte_abs": tolerance} if adaptive else {}
        simulation = Simulation([block], [], [event], dt=dt, dt_max=0.5, Solver=solver, log=False, **options)
        simulation.run(END, adaptive=adaptive)
        return lock[0] if lock else math.inf

    for solver in (RKBS32, RKCK54, RKDP87):
        for tolerance in (1e-2, 1e-3, 1e-4, 1e-6, 1e-8):
            yield "free", f"{solver.__name__}, {tolerance:.0e}", lambda s=solver, t=tolerance: run(s, True, 5e-3, t)
    for dt in (5e-3, 1e-3):
        yield "free", f"RK4, step {dt * 1e6:g} us", lambda d=dt: run(RK4, False, d, 1e-4)


_MJCF = """<mujoco>
<option gravity="0 0 0" integrator="{integrator}" tolerance="1e-12"><flag contact="disable"/></option>
<worldbody>
<body><joint name="j1" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 {j1}"/></body>
<body><joint name="j2" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 {j2}"/></body></worldbody>
<tendon><fixed name="slip" frictionloss="1"><joint joint="j1" coef="1"/><joint joint="j2" coef="-1"/></fixed></tendon>
</mujoco>"""


def by_mujoco() -> Iterator[Candidate]:
    """Yield dry friction of a fixed tendon over both joints, as hard as possible; steps in C once the capacity is constant."""
    import mujoco
    from mujoco import rollout

    def prepared(integrator: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
        model = mujoco.MjModel.from_xml_string(_MJCF.format(integrator=integrator, j1=J1, j2=J2))
        model.tendon_solimp_fri[:] = 0.99999, 0.99999, 0.001, 0.5, 2.0
        return model, mujoco.MjData(model)

    def pace(model: mujoco.MjModel, step: float) -> None:
        model.opt.timestep = step
        model.tendon_solref_fri[:] = 2.0 * step, 1.0

    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    low, high = 0.5 - 0.5 / math.sqrt(3.0), 0.5 + 0.5 / math.sqrt(3.0)

    def run(model: mujoco.MjModel, data: mujoco.MjData, step: float, rest: float) -> float:
        mujoco.mj_resetData(model, data)
        pace(model, step)
        data.qfrc_applied[:] = DRIVE, LOAD
        data.qvel[:] = W1, 0.0
        for i in range(round(RISE / step)):
            # the mean over the step, from its two Gauss points as in our driveline
            first, second = (problem.capacity((i + share) * step) for share in (low, high))
            model.tendon_frictionloss[0] = 0.5 * (first + second)
            mujoco.mj_step(model, data)
        model.tendon_frictionloss[0] = CAPACITY
        pace(model, rest)
        steps = math.ceil((END - RISE) / rest - 1e-9)
        state = np.empty(mujoco.mj_stateSize(model, full))
        mujoco.mj_getState(model, data, state, full)
        force = np.tile(data.qfrc_applied, (1, steps, 1))
        states, _ = rollout.rollout(model, data, state[None], force, control_spec=mujoco.mjtState.mjSTATE_QFRC_APPLIED, nstep=steps)
        speeds = np.concatenate((state[None], states[0]))[:, 1 + model.nq : 1 + model.nq + model.nv]
        return _lock(RISE + rest * np.arange(len(speeds)), speeds[:, 0] - speeds[:, 1])

    for integrator in ("Euler", "implicitfast", "RK4"):
        model, data = prepared(integrator)
        for step in (15e-3, 5e-3, 2.5e-3, 1e-3, 5e-4):
            for rest in (step, 20e-3):
                yield (
                    "free",
                    f"{integrator}, steps {step * 1e6:g} and {rest * 1e6:g} us",
                    lambda m=model, d=data, s=step, r=rest: run(m, d, s, r),
                )


def _lock(t: np.ndarray, slip: np.ndarray) -> float:
    """Return the time at which the slip becomes zero [s], from the straight line of the step before."""
    still = np.flatnonzero(slip < 0.01 * W1)
    if not len(still) or still[0] < 2:
        return math.inf
    i = still[0] - 1
    return float(t[i] + slip[i] * (t[i] - t[i - 1]) / (slip[i - 1] - slip[i]))


def by_drake() -> Iterator[Candidate]:
    """Yield a witness function on a system in Python, and built-in systems in C++ with a monitor on their steps."""
    for scheme in ("runge_kutta3", "runge_kutta5"):
        for accuracy in (1e-1, 1e-2, 1e-4, 1e-6):
            yield "free", f"witness, {scheme}, {accuracy:.0e}", _witnessed(scheme, accuracy)
            yield "free", f"built in, {scheme}, {accuracy:.0e}", _built_in(scheme, accuracy)


def _simulator(system: System, scheme: str, accuracy: float) -> Simulator:
    """Return Drake's simulator of a system with an integrator of an accuracy."""
    from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator

    simulator = Simulator(system)
    ResetIntegratorFromFlags(simulator, scheme, 1.0)
    simulator.get_mutable_integrator().set_target_accuracy(accuracy)
    simulator.get_mutable_context().SetAccuracy(accuracy)
    return simulator


def _witnessed(scheme: str, accuracy: float) -> Callable[[], float]:
    """Return a run with a witness function on a system in Python."""
    from pydrake.systems.framework import LeafSystem, UnrestrictedUpdateEvent, WitnessFunctionDirection

    class Clutch(LeafSystem):
        def __init__(self) -> None:
            super().__init__()
            self.DeclareContinuousState(2)
            self.locked, self.lock = False, math.inf
            self.zero = self.MakeWitnessFunction(
                "slip", WitnessFunctionDirection.kPositiveThenNonPositive, self.slip, UnrestrictedUpdateEvent(self.close)
            )

        def slip(self, context: Context) -> float:
            v = context.get_continuous_state_vector()
            return v[0] - v[1]

        def close(self, context: Context, event: UnrestrictedUpdateEvent, state: State) -> None:
            self.locked, self.lock = True, context.get_time()

        def DoGetWitnessFunctions(self, context: Context) -> list[WitnessFunction]:
            return [] if self.locked else [self.zero]

        def DoCalcTimeDerivatives(self, context: Context, derivatives: ContinuousState) -> None:
            if self.locked:
                rate = (DRIVE + LOAD) / (J1 + J2)
                derivatives.get_mutable_vector().SetFromVector(np.array((rate, rate)))
                return
            torque = problem.capacity(context.get_time())
            derivatives.get_mutable_vector().SetFromVector(np.array(((DRIVE - torque) / J1, (LOAD + torque) / J2)))

    def witnessed(system: Clutch, simulator: Simulator) -> float:
        system.locked, system.lock = False, math.inf
        context = simulator.get_mutable_context()
        context.SetTime(0.0)
        context.SetContinuousState(np.array((W1, 0.0)))
        simulator.Initialize()
        simulator.AdvanceTo(END)
        return system.lock

    system = Clutch()
    simulator = _simulator(system, scheme, accuracy)
    return lambda: witnessed(system, simulator)


def _built_in(scheme: str, accuracy: float) -> Callable[[], float]:
    """Return a run of built-in systems in C++ with a monitor on their steps."""
    from pydrake.systems.framework import EventStatus
    from pydrake.systems.primitives import AffineSystem, TrajectoryAffineSystem
    from pydrake.trajectories import PiecewisePolynomial

    knots = np.linspace(0.0, RISE, 17)
    slope = CAPACITY * 0.5 * math.pi / RISE * np.cos(0.5 * math.pi * knots / RISE)
    torque = np.array([problem.capacity(t) for t in knots])
    forces = np.array(((DRIVE - torque) / J1, (LOAD + torque) / J2))
    rising = PiecewisePolynomial.CubicHermite(knots, forces, np.array((-slope / J1, slope / J2)))
    none = np.zeros((2, 2))

    def constant(shape: tuple[int, int]) -> PiecewisePolynomial:
        return PiecewisePolynomial(np.zeros(shape))

    def affine(rates: Sequence[float]) -> AffineSystem:
        return AffineSystem(none, np.zeros((2, 0)), np.array(rates), np.zeros((0, 2)), np.zeros((0, 0)), np.zeros(0))

    def built() -> list[Simulator]:
        parts = [
            TrajectoryAffineSystem(
                constant((2, 2)), constant((2, 0)), rising, constant((0, 2)), constant((0, 0)), constant((0, 1))
            ),
            affine(((DRIVE - CAPACITY) / J1, (LOAD + CAPACITY) / J2)),
            affine(((DRIVE + LOAD) / (J1 + J2),) * 2),
        ]
        return [_simulator(part, scheme, accuracy) for part in parts]

    def switched(simulators: list[Simulator]) -> float:
        v, begin, lock, last = np.array((W1, 0.0)), 0.0, np.nan, []

        def watch(context: Context) -> EventStatus:
            x = context.get_continuous_state_vector()
            last.append((context.get_time(), x[0] - x[1]))
            return EventStatus.ReachedTermination(None, "") if last[-1][1] <= 0.0 else EventStatus.DidNothing()

        for k, (simulator, end) in enumerate(zip(simulators, (RISE, END, END))):
            context = simulator.get_mutable_context()
            context.SetTime(begin)
            context.SetContinuousState(v)
            if k == 1:
                simulator.set_monitor(watch)
            simulator.Initialize()
            simulator.AdvanceTo(end)
            v, begin = context.get_continuous_state_vector().CopyToVector(), end
            if k == 1:  # the rates are constant here: the straight line back to zero slip is exact
                simulator.clear_monitor()
                (t0, s0), (t1, s1) = last[-2:]
                begin = lock = t1 + (t1 - t0) * s1 / (s0 - s1)
                v = v - (t1 - lock) * np.array(((DRIVE - CAPACITY) / J1, (LOAD + CAPACITY) / J2))
        return lock

    simulators = built()
    return lambda: switched(simulators)


TOOLS = {"this project": ours, "scipy": by_scipy, "pathsim": by_pathsim, "mujoco": by_mujoco, "drake": by_drake}


def measure(candidates: Iterable[Candidate], budget: float, tell: Callable[[str], object] = lambda text: None) -> list[Point]:
    """Measure every candidate of a tool.

    Parameters
    ----------
    candidates : iterable of Candidate
        The candidates.
    budget : float
        Time for the runs of one candidate [s]; at least two runs are made, and the fastest counts.
    tell : callable
        Receives the setting of each candidate before it is measured.

    Returns
    -------
    list of Point
        One for each candidate.
    """
    exact, points = problem.lock_up(), []
    for way, setting, call in candidates:
        tell(setting)
        error = abs(call() - exact) / exact
        spent = fastest(call, budget, least=2)
        points.append(Point(way, setting, error, spent.cpu, END / spent.cpu))
    return points


def best(points: list[Point], way: str, error: float) -> Point | None:
    """Return the cheapest candidate that is exact enough.

    Parameters
    ----------
    points : list of Point
        The measured candidates of a tool.
    way : str
        "free" or "stopped".
    error : float
        Largest relative error of the lock-up time.

    Returns
    -------
    Point or None
        None when no candidate is exact enough.
    """
    good = [point for point in points if point.way == way and point.error <= error]
    return min(good, key=lambda point: point.cpu_s) if good else None


def bench_peers(budget: float = 0.25, tell: Callable[[str], object] = lambda text: None) -> dict:
    """Measure all tools.

    Parameters
    ----------
    budget : float
        Time for the runs of one candidate [s].
    tell : callable
        Receives each tool and setting before it is measured.

    Returns
    -------
    dict
        Exact lock-up time [s], ERRORS, for each tool its version, its candidates and the best one at each error, and the
        names of missing tools.
    """
    out: dict = {"exact_lock_s": problem.lock_up(), "errors": list(ERRORS), "tools": {}, "missing": []}
    for tool, make in TOOLS.items():
        known = installed("rig_nodes") or "" if tool == "this project" else installed(tool)
        if known is None:
            out["missing"].append(tool)
            continue
        points = measure(make(), budget, lambda setting, tool=tool: tell(f"{tool}: {setting}"))
        out["tools"][tool] = {
            "version": known,
            "points": [point._asdict() for point in points],
            "best": {
                way: [found and found._asdict() for found in (best(points, way, error) for error in ERRORS)]
                for way in ("free", "stopped")
                if any(point.way == way for point in points)
            },
        }
    return out
