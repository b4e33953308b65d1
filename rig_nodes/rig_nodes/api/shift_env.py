# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A shift as an environment of gymnasium: ``gymnasium.make("rig_nodes/Shift-v0")`` after ``import rig_nodes``.

A sequence brings the rig to the order of the shift; what happens from there on is the agent's. It stands on a session.
"""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis import BEFORE, every_metric, quality_of, shift_metrics
from ..bags import Recording
from ..base import ROW, SAMPLE, RigError, brief, optional, unknown
from ..controllers import load_controller
from ..plant import HIGH, LOW
from ..runs import ORDER, Session, load_sequence
from ..studies import BOUNDS, settings, values_of
from .rig import Rig, load
from .run import shift_cells
from .table import GEARS

if TYPE_CHECKING:
    from pathlib import Path

    import gymnasium
else:
    gymnasium = optional("gymnasium", "learn")

Box = gymnasium.spaces.Box
ACTIONS = ("currents", "profile")
# reward for a unit of each metric, in its unit of reports; energy counts in the step in which it is lost, the others at the end
WEIGHTS = {"k": 1.0, "t_c_s": -1.0, "input_torque_high_nm": -0.005, "e_loss_j": -0.0005}
LOSS = "e_loss_j"
FAILED = -10.0  # reward of the last step of a shift that a limit or a trip ends, or that is not valid
STANDS = 1.0  # rad/s of the output, below which the drive is interrupted
UNIT = 1e-3  # s and A of a number of a profile, which the box takes in whole ms and mA
WORDS = (*GEARS, "quality", "valid")  # cells of a shift that are no numbers


class ShiftEnv(gymnasium.Env):
    """One shift, from its order on.

    Observation: what the transducers show (transducers,) [SI], in the order of ``transducers``; never a true value.

    Action with ``actions="currents"``: current of each valve (valves,) [A], in the order of ``valves``, held for a step; it acts
    one millisecond later, as every controller's. With ``actions="profile"``: the eleven numbers of ``points``, times [s] and
    currents [A] of the Alfa46's profiles and its delay, rounded to the whole ms and mA that it takes; the episode is then a single
    step. Either is clipped to the space.

    Reward: the weighted energy lost in the step beyond what the old gear loses, from torques and speeds as measured; at the end of
    the window the other weighted metrics of the shift come on top. A shift that is not valid, and one that a trip or a limit ends,
    gets -10 instead.

    The seed of a reset is the seed of the run: ``reset(seed=k)`` is ``rig simulate SEQUENCE --seed k`` until the order.

    Parameters
    ----------
    rig : str, Path or Rig
        The rig; "hydmag" for the registered environment.
    sequence : str or Path
        Sequence that brings the rig to the order of the shift; "demo" for the registered environment.
    way : str, optional
        The shift, e.g. "I-II", the first of this kind in the sequence; otherwise the first of the rig.
    actions : str
        "currents" or "profile".
    step : float
        Time of a step with currents [s].
    window : float
        Time from the order to the end of the episode [s], at most 1.7 s.
    weights : mapping of str to float, optional
        Reward for a unit of each metric by its key (``rig list metrics``).
    limits : mapping of str to (float, float), optional
        Lowest and highest allowed reading [SI] of transducers by name; beyond them the episode ends. By default the output must not
        stop, and the input torque must stay in its meter's range.

    Attributes
    ----------
    session : Session
        The rig after a reset; its ``true`` values are for plots, not for agents.
    transducers, valves, points : tuple of str
        Names of the observations, and of the actions of both kinds.

    Raises
    ------
    RigError
        When the rig, the sequence, the shift or an argument does not fit.

    Examples
    --------
    >>> import gymnasium, rig_nodes
    >>> env = gymnasium.make("rig_nodes/Shift-v0", actions="profile")
    >>> observation, _ = env.reset(seed=1)
    >>> action = env.unwrapped.own_profile()
    >>> _, reward, terminated, _, info = env.step(action)
    >>> terminated, info["metrics"]["valid"], 0.5 < info["metrics"]["t_c_s"] < 0.8
    (True, True, True)
    """

    def __init__(
        self,
        rig: str | Path | Rig,
        sequence: str | Path,
        way: str | None = None,
        actions: str = "currents",
        step: float = 0.010,
        window: float = 1.5,
        weights: Mapping[str, float] | None = None,
        limits: Mapping[str, tuple[float, float]] | None = None,
    ) -> None:
        loaded = rig if isinstance(rig, Rig) else load(rig)
        self.config = loaded.config
        if actions not in ACTIONS:
            raise RigError(f"actions is {brief(actions)}, expected 'currents' or 'profile'")
        if not self.config.structure.shifts:
            raise RigError(f"'{self.config.name}' has no shift controller, so it has no shifts to learn")
        ways = self.config.transmission.ways()
        way = next(iter(ways), "") if way is None else way
        if not isinstance(way, str) or way not in ways:
            raise RigError(unknown("shift", str(way), ways))
        self._sequence = load_sequence(sequence, {}, loaded.source, None, self.config)
        self._way, self._gears = way, ways[way]
        self._orders = self._number_of()
        self._currents = actions == "currents"
        self._window = self._whole(window, "window", 1.7)
        self._samples = self._whole(step, "step", window)
        self._weights = _mapping(WEIGHTS if weights is None else weights, "weights", "a number by the key of a metric")
        for key, weight in self._weights.items():
            if key not in {one.key for one in every_metric()}:
                raise RigError(unknown("metric", str(key), [one.key for one in every_metric()]))
            if not _is_number(weight) or not np.isfinite(weight):
                raise RigError(f"weights: {key} is {brief(weight)}, expected a number")
        self.session = Session(self.config)
        self.transducers = self.session.transducers
        self.valves, self.points = self.session.rig.valve_names, tuple(BOUNDS)
        self._columns = np.array([self.session.rig.channels.index(name) for name in self.transducers])
        table = self.session.rig.gauges.table[:, self._columns]
        self.observation_space = Box(table[LOW], table[HIGH], dtype=np.float64)
        self.action_space = self._actions()
        self._set_limits(limits)
        box, channels = self.config.transmission, self.session.rig.channels
        self._power = [channels.index(name) for end in (box.input, box.output) for name in (end.torque, end.speed)]
        self._begun: tuple[int, Any] | None = None  # seed of the newest run, and its session at the order
        self._ordered = 0

    def _number_of(self) -> int:
        """Return the number of the first order of the shift among the orders of the sequence."""
        before, number = 0, 0
        for one in self._sequence.steps:
            if one.kind == "shift":
                number += 1
                if (before, int(one.value)) == self._gears:
                    return number
                before = int(one.value)
        raise RigError(f"sequence '{self._sequence.name}' orders no shift {self._way}")

    @staticmethod
    def _whole(seconds: float, what: str, most: float) -> int:
        samples = round(seconds / SAMPLE) if _is_number(seconds) and np.isfinite(seconds) else 0
        if not samples or abs(samples * SAMPLE - seconds) > 1e-9 or not SAMPLE <= seconds <= most:
            raise RigError(f"{what} is {brief(seconds)}, expected a time in s, whole milliseconds from 0.001 to {most}")
        return samples

    def _actions(self) -> Box:
        if self._currents:
            limit = self.config.alfa46.values.current_limit
            return Box(0.0, limit, (len(self.valves),), dtype=np.float64)
        low, high = np.array(list(BOUNDS.values()), float).T * UNIT
        own = self.own_profile()
        return Box(np.minimum(low, own), np.maximum(high, own), dtype=np.float64)

    def _set_limits(self, limits: Mapping[str, tuple[float, float]] | None) -> None:
        box, space = self.config.transmission, self.observation_space
        if limits is None:
            torque = self.transducers.index(box.input.torque)
            # a transducer shows nothing beyond the ends of its range, so that it is at them where the torque is beyond
            ends = np.nextafter((space.low[torque], space.high[torque]), (np.inf, -np.inf))
            limits = {box.output.speed: (STANDS, np.inf), box.input.torque: (float(ends[0]), float(ends[1]))}
        self._lowest, self._highest = (np.full(len(self.transducers), end) for end in (-np.inf, np.inf))
        for name, ends in _mapping(limits, "limits", "the lowest and highest reading by the name of a transducer").items():
            if name not in self.transducers:
                raise RigError(unknown("transducer", str(name), self.transducers))
            low, high = ends if isinstance(ends, tuple | list) and len(ends) == 2 else (None, None)
            if not (_is_number(low) and _is_number(high) and low < high):
                raise RigError(f"limits: {name} is {brief(ends)}, expected two numbers, the lower one first")
            place = self.transducers.index(name)
            self._lowest[place], self._highest[place] = low, high

    def own_profile(self) -> np.ndarray:
        """Return the action with ``actions="profile"`` that is the rig's own profile (points,) [s, A]."""
        own = values_of(self.config.alfa46, self._way, self.config.transmission)
        return np.array([own[name] for name in BOUNDS]) * UNIT

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        """Bring the rig to the order of the shift.

        Parameters
        ----------
        seed : int, optional
            Seed of the run; without one it is drawn from the environment's own random numbers.
        options : dict, optional
            Not used.

        Returns
        -------
        observation : (transducers,) array of float
            What the transducers show at the order [SI].
        info : dict
            ``time`` of the order [s] and ``seed`` of the run.

        Raises
        ------
        RigError
            When the rig does not get as far as the order; the sentence says why.
        """
        super().reset(seed=seed)
        run = int(self.np_random.integers(1, 1 << 31)) if seed is None else seed
        if self._begun is None or self._begun[0] != run:
            self._begun = run, self._brought(run)
        self.session, moment, before = self._begun[1]
        self.session.restore(moment)
        self._before, self._ordered = before, self.session.rig.sample
        self._held = self._net(before) / len(before)
        return self._seen(), {"time": self.session.time, "seed": run}

    def _brought(self, seed: int) -> tuple:
        """Return a session at the order with its snapshot, and its rows of the time before that the metrics need."""
        plug = load_controller("alfa46", self.config, "current") if self._currents else "embedded"
        session = Session(self.config, seed, plug)
        session.play(self._sequence, self._orders)
        rig = session.rig
        if rig.safe:
            raise RigError(f"the rig tripped before the shift was ordered: {rig.reason}")
        if self._currents:  # from the order on the agent is the controller
            session = Session(self.config, seed, "external", "current")
            session.rig.restore(rig.snapshot())
            session.set(ORDER, self.config.transmission.names[self._gears[1]])
        rows = round(BEFORE / ROW) + 1
        return session, session.snapshot(), rig.rows_at(ROW, round(rig.sample * SAMPLE / ROW) - rows + 1, rows)

    def _seen(self) -> np.ndarray:
        return self.session.rig.row()[self._columns]

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Act for a step, or with a profile for the whole shift.

        Parameters
        ----------
        action : (valves,) or (points,) array of float
            Currents [A], or times [s] and currents [A] of the profile.

        Returns
        -------
        observation : (transducers,) array of float
            What the transducers show then [SI].
        reward : float
            The reward.
        terminated : bool
            True at the end of the window, after a trip and beyond a limit.
        truncated : bool
            Always False.
        info : dict
            At the end ``metrics``, a row as of ``Run.shifts`` without what was not found and what only a recording shows; and
            ``reason``, a sentence, where the shift was not made.

        Raises
        ------
        RigError
            When the action has another shape, or a number is NaN.
        """
        session, space = self.session, self.action_space
        given = np.asarray(action, float)
        if given.shape != space.shape or np.isnan(given).any():
            names = self.valves if self._currents else self.points
            raise RigError(f"action is {brief(given.tolist())}, expected {len(names)} numbers: {', '.join(names)}")
        values = np.minimum(np.maximum(given, space.low), space.high).tolist()
        rig, first = session.rig, session.rig.sample
        end = self._ordered + self._window
        if self._currents:
            self._command(values)
            session.advance(min(self._samples, end - first) * SAMPLE)
        else:
            numbers = {name: round(value / UNIT) for name, value in zip(BOUNDS, values)}
            rig.set_controller(settings(self.config.alfa46, self._way, numbers, self.config.transmission))
            session.advance(self._window * SAMPLE)
        seen, rows = self._seen(), self._rows(first)
        reward = self._weights.get(LOSS, 0.0) * self._lost(rows)
        if reason := self._beyond(rows):
            return seen, FAILED, True, False, {"reason": reason}
        if rig.sample < end:
            return seen, reward, False, False, {}
        row = self._metrics()
        if not row["valid"]:
            return seen, FAILED, True, False, {"reason": "; ".join(row["why"]), "metrics": self._cells(row)}
        reward += sum(weight * (row[key] or 0.0) for key, weight in self._weights.items() if key != LOSS)
        return seen, reward, True, False, {"metrics": self._cells(row)}

    def _command(self, values: list[float]) -> None:
        currents = [0.0] * self.config.structure.outputs
        for output, value in zip(self.config.wiring, values):
            currents[output] = value
        self.session.set("current", currents)

    def _net(self, rows: np.ndarray) -> float:
        """Return the sum over rows (rows, channels) of the power that goes in and not out [W]."""
        into, speed_in, out, speed_out = self._power
        return float(rows[:, into] @ rows[:, speed_in] - rows[:, out] @ rows[:, speed_out])

    def _rows(self, first: int) -> np.ndarray:
        """Return the logger's rows (rows, channels) since a sample."""
        rig = self.session.rig
        begin = first * rig.rows_per_sample
        return rig.rows_in_ring(rig.row_period, begin, rig.sample * rig.rows_per_sample - begin)

    def _lost(self, rows: np.ndarray) -> float:
        """Return the energy lost in rows beyond what the gear lost before the order [J]."""
        return (self._net(rows) - len(rows) * self._held) * self.session.rig.row_period

    def _beyond(self, rows: np.ndarray) -> str:
        """Return why the episode ends before its time, by all that the transducers have shown in a step; empty when it goes on."""
        if self.session.rig.safe:
            return f"the rig tripped: {self.session.reason}"
        shown = rows[:, self._columns]
        beyond = (shown < self._lowest) | (shown > self._highest)
        if not beyond.any():
            return ""
        row, place = np.unravel_index(int(beyond.argmax()), beyond.shape)
        signal = self.config.catalogue.signal(self.transducers[place])
        return f"{signal.name} is {signal.shown(float(shown[row, place])):.4g} {signal.display_unit}, beyond its limit"

    def _metrics(self) -> dict[str, Any]:
        rig, box = self.session.rig, self.config.transmission
        first = round(self._ordered * SAMPLE / ROW)
        rows = np.vstack((self._before, rig.rows_at(ROW, first + 1, round(rig.sample * SAMPLE / ROW) - first)))
        channels = {name: np.ascontiguousarray(rows[:, rig.channels.index(name)]) for name in box.channels}
        order = (self._ordered * SAMPLE, *self._gears)
        begin = first + 1 - len(self._before)
        return shift_metrics(Recording(begin * ROW, ROW, channels, [order], box), order)

    def _cells(self, row: dict[str, Any]) -> dict[str, Any]:
        """Return a shift as a row of ``Run.shifts`` without what has no value, of which a vector of environments keeps a mask."""
        cells = shift_cells(row, quality_of(row, self.config.transmission), self.config.transmission)
        return {key: one if key in WORDS else float(one) for key, one in cells.items() if one is not None}


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _mapping(given: object, what: str, expected: str) -> dict:
    if not isinstance(given, Mapping):
        raise RigError(f"{what} is {brief(given)}, expected {expected}")
    return {**given}
