# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The faults of a rig that runs: when each begins, grows and ends, and what it changes at sample boundaries.

runs.rig owns them where they are enabled. The compiled step knows nothing of them: it reads the values that they write.
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from ..base import SAMPLE, TICK_SAMPLES, RigError
from ..plant import GROWING, HIGH, INTERMITTENT, LINES, LOW, MEASUREMENTS, MESSAGES, NOISE, TRANSDUCER, uniform
from ..rig import CONTROLLER, CONTROLLER_COMMAND, FAULT_OFF, FAULT_ON, FAULT_ORDERED, OUTPUT_KEYS, FaultOrder, faults_of, read_fault

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

    from .rig import Rig

NEVER = 1 << 62  # sample that does not come
LATE, LOST, DOUBLED, CORRUPTED = "late", "lost", "doubled", "corrupted"
DRAWS = {MESSAGES: 1 << 33, MEASUREMENTS: (1 << 33) + (1 << 16)}  # numbers of the first channels of random values of messages


class News(NamedTuple):
    """What becomes an event: its sample, name, text and value, the size [SI]."""

    sample: int
    name: str
    text: str
    value: float


@dataclass
class Acting:
    """An order that is not over.

    Parameters
    ----------
    order : FaultOrder
        The order.
    due : int
        Sample at which it begins, or from which its trigger is awaited.
    began : int
        Sample at which it began; -1 before.
    level : float
        Share of its size that acts now.
    shifts : dict of str to float
        What it has added to states of its device.
    held : list of float
        What its transducer read as it began, or the true values that it has kept since then [SI].
    """

    order: FaultOrder
    due: int
    began: int = -1
    level: float = 0.0
    shifts: dict[str, float] = field(default_factory=dict)
    held: list[float] = field(default_factory=list)


class _Written:
    """Values that faults overwrite, with the healthy ones behind them; a plant.faults.fault.Target of the order that acts."""

    span = 0.0

    def __init__(self, values: Any, states: Any = None, configs: tuple[Any, ...] = ()) -> None:
        self.values, self.states, self.configs = values, states, configs
        self.healthy: dict[Hashable, Any] = {}
        self.acting: Acting | None = None

    def __getitem__(self, name: Any) -> float:
        return float(self.values[name])

    def __setitem__(self, name: Any, value: float) -> None:
        self.healthy.setdefault(name, self.values[name])
        self.values[name] = value

    def shift(self, state: str, by: float) -> None:
        """Add to a state, in all so much by the order that acts."""
        self.states[state] += by - self.acting.shifts.get(state, 0.0)
        self.acting.shifts[state] = by

    def restore(self) -> None:
        """Write the healthy values back."""
        for name, value in self.healthy.items():
            self.values[name] = value
        self.healthy.clear()


class _Column:
    """The column of a transducer in the table of the gauges, by its rows."""

    def __init__(self, table: np.ndarray, column: int) -> None:
        self.table, self.column = table, column

    def __getitem__(self, row: int) -> float:
        return float(self.table[row, self.column])

    def __setitem__(self, row: int, value: float) -> None:
        self.table[row, self.column] = value


class _Channel(_Written):
    """A transducer as a target."""

    def __init__(self, rig: Rig, name: str, other: str, swaps: list[tuple[str, str]]) -> None:
        self.rig, self.name, self.other = rig, name, other
        one = next(one for one in rig.config.structure.transducers if one.name == name)
        super().__init__(_Column(rig.gauges.table, rig.channels.index(name)))
        self.span, self._swaps = getattr(rig.config.instruments, f"{one.like}_range"), swaps

    def held(self) -> float:
        """Return what it read as the fault began, in its range [SI]."""
        held = self.acting.held
        if not held:
            held.append(min(max(self.rig.measurement(self.name), self[LOW]), self[HIGH]))
        return held[0]

    def keep(self, one: Acting) -> None:
        """Keep the true value on the wire at this sample, in a ring as long as the fault's largest delay."""
        name, place = self.name, (self.rig.sample - one.began) % _kept(one)
        for pair in reversed(self._swaps):  # whose wire it is now
            name = pair[name == pair[0]] if name in pair else name
        one.held[place : place + 1] = [self.rig.shown_truly(name)]

    def earlier(self, time: float) -> float:
        """Return the kept value of so long ago [s, SI] at the end of the next sample, until which it is shown."""
        one, passed = self.acting, self.rig.sample - self.acting.began
        return one.held[max(0, passed + 1 - _samples(time)) % _kept(one)]

    def swap(self) -> None:
        """Exchange its wire and that of the next one of its type."""
        self._swaps.append((self.name, self.other))
        self.rig.swap_wires(self.name, self.other)


class _Profile(_Written):
    """The profile of an output of the embedded controller, whose healthy points are those of the settings."""

    def __init__(self, rig: Rig, output: int) -> None:
        self.rig, self.output = rig, output
        super().__init__(rig.profile(output))

    def restore(self) -> None:
        """Write the points that are set."""
        self.values[:] = self.rig.config.alfa46.profiles[self.output]


class Line:
    """The messages in one direction between controller and rig, and what is wrong with them.

    Parameters
    ----------
    seed : int
        Seed by which it is drawn which of them a fault meets.
    part : str
        One of plant.LINES.

    Attributes
    ----------
    levels : dict of str to float
        What acts now: a delay [s], and shares of the messages.
    """

    def __init__(self, seed: int, part: str) -> None:
        self._seed, self._draws = seed, DRAWS[part]
        self.levels = dict.fromkeys((LATE, LOST, DOUBLED, CORRUPTED), 0.0)

    def carried(
        self, boundary: int, sample: int, values: Sequence[float], ranges: Sequence[tuple[float, float]]
    ) -> list[tuple[int, list[float]]]:
        """Return what arrives of a message, by the boundary at which each is there.

        Parameters
        ----------
        boundary : int
            Boundary at which the message would be there.
        sample : int
            The sample that it answers, or tells.
        values : sequence of float
            Its numbers.
        ranges : sequence of (float, float)
            The smallest and the largest of each.

        Returns
        -------
        list of (int, list of float)
            Boundaries and values; empty where the message is lost. NEVER is the boundary of a copy, which waits for the next one.
        """
        if self._drawn(LOST, sample):
            return []
        values, boundary = list(values), boundary + round(self.levels[LATE] / SAMPLE)
        if self._drawn(CORRUPTED, sample):
            values = [low + (high - low) * self._uniform(CORRUPTED, sample, k + 1) for k, (low, high) in enumerate(ranges)]
        return [(boundary, values), *([(NEVER, values)] if self._drawn(DOUBLED, sample) else [])]

    def _drawn(self, what: str, sample: int) -> bool:
        return self.levels[what] > 0.0 and self._uniform(what, sample, 0) < self.levels[what]

    def _uniform(self, what: str, sample: int, number: int) -> float:
        return uniform(self._seed, self._draws + 8 * list(self.levels).index(what) + number, sample)


class Faults:
    """The faults of one rig.

    Parameters
    ----------
    rig : Rig
        The rig, built; its configuration has the orders with which it begins.

    Attributes
    ----------
    next : int
        Next sample at which something may change.
    acting : list of Acting
        The orders that are not over, in the order in which they came.
    lines : dict of str to Line
        The messages between controller and rig, by plant.LINES.
    """

    def __init__(self, rig: Rig) -> None:
        self._rig, self.known = rig, faults_of(rig.config)
        self.acting: list[Acting] = []
        self._targets: dict[str, _Written] = {}
        self._swaps: list[tuple[str, str]] = []  # transducers whose wires are exchanged, one pair after the other
        self.lines = {part: Line(rig.seed, part) for part in LINES}
        self._news: list[News] = []
        self._readings: Any = None
        self.next = NEVER
        for text in rig.config.faults or ():
            self._take(self.check(text))
        self.act()

    # ---- orders

    def order(self, text: str) -> None:
        """Take an order, which is an event with its text.

        Parameters
        ----------
        text : str
            As rig.faults.read_fault takes it.

        Raises
        ------
        RigError
            When the rig refuses it.
        """
        order = self.check(text)
        self._tell(FAULT_ORDERED, order.text, order.size)
        self._take(order)
        self.act()

    def check(self, text: str) -> FaultOrder:
        """Return an order that the rig takes as it stands now; RigError, as for :meth:`order`."""
        rig, order = self._rig, read_fault(self._rig.config, text, "fault")
        if order.of.fault.part in LINES and rig.embedded:
            raise RigError(f"fault {order.of.name} refused: the Alfa46 runs inside the rig, without messages; plug a controller")
        if order.of.fault.part == MEASUREMENTS and not rig.plugged:
            raise RigError(
                f"fault {order.of.name} refused: here all read the rig's measurements from the same topics or outputs; a plugged "
                "controller gets its own in simulate, in a session and in run --speed"
            )
        if order.of.fault.part == CONTROLLER and not rig.embedded:
            raise RigError(f"fault {order.of.name} refused: the shift controller is outside, and its fill times are its own")
        same = self._same(order)
        if order.off and not same:
            raise RigError(f"fault {order.of.name} cannot end: it is not there; {self._there()}")
        if same and not order.off:
            raise RigError(f"fault {order.of.name} is there already ({same[0].order.text}); end it with off=true first")
        if order.of.fault.pairs and not order.off:
            for of in (one.order.of for one in self.acting):
                if of.fault.pairs and {of.owner, of.configs[1]} == {order.of.owner, order.of.configs[1]}:
                    raise RigError(f"fault {order.of.name} refused: {of.name} exchanges the same two wires; end it first")
        return order

    def _same(self, order: FaultOrder) -> list[Acting]:
        return [one for one in self.acting if one.order.of.name == order.of.name]

    def _take(self, order: FaultOrder) -> None:
        for one in self._same(order) if order.off else ():
            self._end(one)
        if not order.off:
            self.acting.append(Acting(order, self._rig.sample + round(order.at / SAMPLE)))
        self.next = self._rig.sample

    def _there(self) -> str:
        names = [one.order.of.name for one in self.acting]
        return f"there {'is' if len(names) == 1 else 'are'} {', '.join(names) or 'none'}"

    def _end(self, one: Acting) -> None:
        self.acting.remove(one)
        states = self._target(one).states
        for state, by in one.shifts.items():
            states[state] -= by
        if one.began >= 0:
            self._tell(FAULT_OFF, f"{one.order.of.name} ended", 0.0)

    def _tell(self, name: str, text: str, value: float) -> None:
        self._news.append(News(self._rig.sample, name, text, value))

    def take_news(self) -> list[News]:
        """Return what has happened since the last call."""
        news, self._news = self._news, []
        return news

    # ---- time

    def act(self) -> None:
        """Do what is due at the present sample; without anything due this does nothing."""
        sample, changed = self._rig.sample, False
        if sample < self.next:
            return
        for one in list(self.acting):
            if one.began < 0 and sample >= one.due and self._triggered(one, sample):
                one.began = sample
                self._tell(FAULT_ON, one.order.sentence(), one.order.size if one.order.of.fault.size else 1.0)
            if one.began < 0:
                continue
            if (sample - one.began) * SAMPLE >= one.order.lasts:
                self._end(one)
                changed = True
                continue
            level = self._level(one, sample)
            changed, one.level = changed or level != one.level, level
            if one.order.of.fault.keeps:
                self._target(one).keep(one)
        if changed or self._targets:
            self.apply()
        self.next = min([self._next_of(one, sample) for one in self.acting], default=NEVER)

    def _level(self, one: Acting, sample: int) -> float:
        order = one.order
        if order.onset == GROWING:  # in the same steps, whatever calls between two ticks
            passed = max(0, sample - sample % TICK_SAMPLES - one.began)
            return min(1.0, passed * SAMPLE / order.over) if order.over > 0.0 else 1.0
        if order.onset == INTERMITTENT:
            return 1.0 if (sample - one.began) % _samples(order.period) < _on(order) else 0.0
        return 1.0

    def _next_of(self, one: Acting, sample: int) -> int:
        order, tick = one.order, (sample // TICK_SAMPLES + 1) * TICK_SAMPLES
        if one.began < 0:
            return max(one.due, tick if sample >= one.due else 0)
        if order.of.fault.keeps:
            return sample + 1
        due = one.began + math.ceil(order.lasts / SAMPLE - 1e-9) if math.isfinite(order.lasts) else NEVER
        if order.onset == GROWING and one.level < 1.0:
            due = min(due, tick)
        if order.onset == INTERMITTENT:
            period = _samples(order.period)
            turn, passed = divmod(sample - one.began, period)
            on = _on(order)
            due = min(due, one.began + turn * period + (on if passed < on else period))
        return max(due, sample + 1)

    def _triggered(self, one: Acting, sample: int) -> bool:
        when = one.order.when
        if when is None:
            return True
        return sample % TICK_SAMPLES == 0 and when.low <= self._reading(when.signal) <= when.high

    def _reading(self, signal: str) -> float:
        """The present value of a signal [SI]: what a transducer shows, a true value, or what the newest command says."""
        if signal in self._rig.channels:
            return self._rig.measurement(signal)
        from .topics import Readings, States  # here, because they read a rig that is built

        if self._readings is None:
            self._readings = States(self._rig), Readings(self._rig.config.catalogue)
        states, readings = self._readings
        topic = readings.topic(signal)
        if topic == CONTROLLER_COMMAND:
            if self._rig.newest_command < 0:
                return math.nan
            readings.fields[topic] = states.command()
        else:
            states.refresh()
            readings.fields[topic] = states.topics[topic]()
        return readings.reading(signal)

    # ---- what acts

    def lift(self) -> None:
        """Take back what all faults have written, for a change of the healthy values; :meth:`apply` writes it again."""
        for target in self._targets.values():
            target.restore()
        while self._swaps:  # two that share a wire come apart only in reversed order
            self._rig.swap_wires(*self._swaps.pop())
        for line in self.lines.values():
            line.levels.update(dict.fromkeys(line.levels, 0.0))

    def apply(self) -> None:
        """Write what the faults that act now change, one after the other from the healthy values."""
        noise = self._rig.gauges.table[NOISE].copy()
        self.lift()
        for one in self.acting:
            if one.began < 0:
                continue
            target, fault = self._target(one), one.order.of.fault
            target.acting = one
            if one.level > 0.0 or one.shifts:
                fault.act(target, one.level * one.order.size)
        used = {_key(one.order) for one in self.acting}
        self._targets = {key: target for key, target in self._targets.items() if key in used}
        if (self._rig.gauges.table[NOISE] != noise).any():
            self._rig.gauges.changes += 1  # who has kept the noise reads it again

    def shifted(self, owner: str, state: str) -> float:
        """Return what faults add to a state of a device [SI]."""
        return sum(one.shifts.get(state, 0.0) for one in self.acting if one.order.of.owner == owner)

    def _target(self, one: Acting) -> _Written:
        of, rig = one.order.of, self._rig
        key = _key(one.order)
        if key not in self._targets:
            if of.fault.part == TRANSDUCER:
                self._targets[key] = _Channel(rig, of.owner, of.configs[1], self._swaps)
            elif of.fault.part in LINES:
                self._targets[key] = _Written(self.lines[of.fault.part].levels)
            elif of.fault.part == CONTROLLER:
                self._targets[key] = _Profile(rig, OUTPUT_KEYS.index(of.owner))
            else:
                self._targets[key] = _Written(rig.world.values(of.owner), rig.device(of.owner), of.configs)
        return self._targets[key]

    # ---- the state, saved and restored

    def snapshot(self) -> tuple:
        """Return the state, for :meth:`restore`."""
        return tuple(map(_copied, self.acting))

    def restore(self, snapshot: tuple) -> None:
        """Return to a state, which :meth:`snapshot` has given; the rig has its values of that moment with the faults lifted."""
        self._targets, self._news = {}, []
        self.acting = [_copied(one) for one in snapshot]
        self.apply()
        self.next = self._rig.sample


def _key(order: FaultOrder) -> str:
    """What an order acts on; a transducer may have the name of a device."""
    return f"{order.of.fault.part}.{order.of.owner}"


def _copied(one: Acting) -> Acting:
    return replace(one, shifts=dict(one.shifts), held=list(one.held))


def _kept(one: Acting) -> int:
    """How many of a transducer's values a fault that delays them keeps."""
    return _samples(one.order.size) + 1


def _on(order: FaultOrder) -> int:
    """For how many samples of its period an intermittent fault acts: of all only where it never goes."""
    on = _samples(order.share * order.period)
    return on if order.share == 1.0 else min(on, _samples(order.period) - 1)


def _samples(seconds: float) -> int:
    return max(1, round(seconds / SAMPLE))
