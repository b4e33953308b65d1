# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The conformance set for shift controllers: a test of every situation that occurs on a rig, with a sentence on each item.

``rig controller check`` and the tests use it. Every item gets a new controller, so a program at the other end of a wire must
take a new run after the end of the last.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from ..base import SAMPLE, RigError
from ..controllers import ControllerFailed, ControllerRecord, Plug, Status, error_text, level_line, load_controller, record_of
from ..rig import NEUTRAL, Clutch, RigConfig, Transmission, with_overrides
from .rig import Rig
from .simulation import advance_with

PERIOD = SAMPLE
UP_AND_DOWN = {100: 1, 1600: 2, 4100: 1, 6600: 0}  # sample of the order -> gear, on the bench of desk()
DESK_SAMPLES = 8000
LOCKED = 2  # mode of a clutch, as in rig_msgs/ClutchState
SHIFT = 10.0  # s that a shift may take on the rig
STORM = (1, 2, 0, 2, 1, 1, 0, 2, 2, 0, 1)
SPEEDS = 157.0, 60.0  # rad/s of input and output shaft on the desk
PRESSURE = 3.0e6  # Pa of a clutch on the desk for each ampere of its valve
# items that do not apply to a controller with a clock of its own (CAN, Modbus), and why
NOT_BY_ITS_OWN_CLOCK = {
    "timing": "the rig keeps to real time and never waits for it, so a step takes no time of its own",
    "determinism": "its clock decides when it reads its inputs, and with that the bits of its answers",
    "restart": "it is not started with a run but goes on from one to the next, so there is no first bit to compare",
}


def locked(rig: Rig, box: Transmission) -> tuple[Clutch, ...]:
    """Return the clutches that are locked now."""
    return tuple(clutch for k, clutch in enumerate(box.clutches) if rig.clutch_mode(k) == LOCKED)


# items that compare with what the controller answered in "answers", and NaN, which such a fault would hide
WITH_ANSWERS = ("at rest", "timing", "determinism", "restart", "late start", "lost samples", "NaN")


class Item(NamedTuple):
    """One line of the table; ``ok`` is None for what does not apply to this controller, or was not ``run``."""

    name: str
    ok: bool | None
    text: str
    run: bool = True


class Seen(NamedTuple):
    """What a controller returned for a sample; the command is None when it discarded the sample."""

    command: tuple | None
    setpoint: tuple | None
    gear: int
    shifting: bool
    flags: int


class Wires(NamedTuple):
    """What the desk's wires carry: coil currents (outputs,) [A] and the transducers of the record [SI]."""

    current: tuple[float, ...]
    measured: tuple[float, ...]


class Desk:
    """A stand-in for the rig: shafts that turn at constant speeds, and pressures that follow the currents of their valves."""

    def __init__(self, record: ControllerRecord) -> None:
        steady = {record.input_speed: SPEEDS[0], record.output_speed: SPEEDS[1]}
        self._outputs = {output.pressure: k for k, output in enumerate(record.outputs) if output.pressure}
        self._rest = [(name, steady.get(name, 0.0)) for name in record.names]
        self.current = [0.0] * len(record.outputs)

    def wires(self) -> Wires:
        """Return what the wires carry now."""
        measured = (PRESSURE * self.current[self._outputs[name]] if name in self._outputs else rest for name, rest in self._rest)
        return Wires(tuple(self.current), tuple(measured))

    def follow(self, setpoint: Iterable[float]) -> None:
        """Advance by a sample towards the controller's current setpoints (outputs,) [A]."""
        for k, wanted in enumerate(setpoint):
            self.current[k] += 0.05 * (wanted - self.current[k])


def desk(
    plug: Plug,
    samples: Iterable[int],
    orders: dict[int, int],
    change: Callable[[int, Wires], Wires] | None = None,
    took: list[float] | None = None,
) -> list[Seen]:
    """Ask a controller for its answers without a plant: coils follow the setpoints, and pressures follow the coils.

    Parameters
    ----------
    plug : Plug
        The controller.
    samples : iterable of int
        Numbers of the samples.
    orders : dict of int to int
        Gear by number of the sample; an order that the seam refuses is left out.
    change : callable, optional
        It is called with (sample, wires) and returns the wires that the controller gets.
    took : list of float, optional
        The time of each step is added to it [s].

    Returns
    -------
    list of Seen
        What the controller returned for each sample.
    """
    stand_in, out = Desk(plug.rig_record), []
    for sample in samples:
        if sample in orders:
            try:
                plug.order(orders[sample])
            except RigError:
                pass  # as on the rig, where the shift before is still running
        wires = stand_in.wires()
        if change is not None:
            wires = change(sample, wires)
        began = time.perf_counter()
        answer = plug.step(sample, *wires, [0.0] * len(plug.wants))
        if took is not None:
            took.append(time.perf_counter() - began)
        out.append(Seen(answer and answer.command, answer and answer.setpoint, plug.gear, plug.shifting, plug.flags))
        if answer is not None:
            stand_in.follow(answer.setpoint)
    return out


def _why(error: Exception) -> str:
    return str(error) if isinstance(error, RigError) else f"the check could not go on: {error_text(error)}"


class Check:
    """The conformance set for one specification of a controller; :meth:`items` runs it.

    Parameters
    ----------
    spec : str or None
        Specification of the controller, as load_controller takes it.
    config : RigConfig
        The rig's configuration.
    level : str, optional
        Level of the controller's commands.
    step_timeout : float or None
        Longest time of a step [s].
    come_timeout : float or None
        Wall-clock time in which a controller of a separate program must connect, for each item [s]; None for no limit.
    say : callable
        It is called with messages for people.
    """

    def __init__(
        self,
        spec: str | None,
        config: RigConfig,
        level: str | None = None,
        step_timeout: float | None = 5.0,
        come_timeout: float | None = 20.0,
        say: Callable[[str], None] = lambda text: None,
    ) -> None:
        """Take the specification; the class describes the parameters."""
        self.spec, self.config, self.level, self.step_timeout, self.say = spec, config, level, step_timeout, say
        self._record = record_of(config)
        self._come_timeout = come_timeout
        self._first: list[Seen] = []
        self._ended: list[str] = []  # for each controller that was ended, what went wrong at its end
        self._abandoned = 0  # controllers that could not be ended after a fatal fault

    def items(self) -> Iterator[Item]:
        """Yield one item after the other; none follows for a controller that cannot be loaded."""
        try:
            plug = self._load()
            text, own_clock = level_line(plug).removeprefix("controller "), plug.own_clock
            self._close(plug)
        except Exception as error:
            yield Item("loads", False, _why(error))
            return
        yield Item("loads", True, text)
        for name, run in (
            ("answers", self._answers),
            ("at rest", self._at_rest),
            ("timing", self._timing),
            ("determinism", self._determinism),
            ("restart", self._restart),
            ("late start", self._late_start),
            ("lost samples", self._lost_samples),
            ("NaN", self._nan),
            ("saturation", self._saturation),
            ("both gears", self._both_gears),
            ("request storm", self._storm),
            ("ends", self._ends),
        ):
            if own_clock and name in NOT_BY_ITS_OWN_CLOCK:
                yield Item(name, None, f"does not apply: {NOT_BY_ITS_OWN_CLOCK[name]}")
                continue
            if name in WITH_ANSWERS and len(self._first) < DESK_SAMPLES:
                yield Item(name, None, "it needs what 'answers' did not get", run=False)
                continue
            try:
                ok, text = run()
            except Exception as error:  # also one that no plug foresaw: every item has a verdict
                ok, text = False, _why(error)
            yield Item(name, ok, text)

    def _load(self) -> Plug:
        plug = load_controller(self.spec, self.config, self.level)
        plug.say = self.say
        plug.pace(self.step_timeout)
        try:
            plug.wait(self._come_timeout)
        except BaseException:
            plug.close()
            raise
        return plug

    def _desk(
        self,
        samples: Iterable[int],
        orders: dict[int, int],
        change: Callable[[int, Wires], Wires] | None = None,
        took: list[float] | None = None,
    ) -> list[Seen]:
        plug = self._load()
        try:
            return desk(plug, samples, orders, change, took)
        finally:
            self._close(plug)

    def _close(self, plug: Plug) -> None:
        plug.close()
        if plug.abandoned:
            self._abandoned += 1
        else:
            self._ended.append(plug.end_fault)

    # ---- the items: (passed, what was seen)

    def _answers(self) -> tuple[bool, str]:
        self._took: list[float] = []
        self._first = self._desk(range(DESK_SAMPLES), UP_AND_DOWN, took=self._took)
        missing = sum(seen.command is None for seen in self._first)
        runs = itertools.groupby(seen.command is None for seen in self._first)
        longest = max((len(list(run)) for none, run in runs if none), default=0)
        text = f"{len(self._first) - missing} of {len(self._first)} samples answered, every value in its range"
        if longest >= 100:
            return False, f"{text}; {longest} samples one after the other without an answer: the rig trips after 100 ms"
        return True, text if not missing else f"{text}; {missing} discarded, at most {longest} one after the other"

    def _at_rest(self) -> tuple[bool, str]:
        before = [seen for seen in self._first[:100] if seen.command is not None]
        if not before:
            return False, "no answer before the first order"
        driven = max(max(seen.command) for seen in before)
        if driven > 0.0 or any(seen.gear or seen.shifting for seen in before):
            return False, (f"before the first order the largest command is {driven:g}; expected none, no gear and no shift")
        return True, "no coil is driven before the first order"

    def _timing(self) -> tuple[bool, str]:
        took = sorted(self._took)
        # the longest times are caused by the machine more than by the controller
        p50, p90, p99 = (took[len(took) * percent // 100] * 1e6 for percent in (50, 90, 99))
        text = f"{p50:.1f} us per step, 90 % below {p90:.1f}, 99 % below {p99:.1f}, longest {took[-1] * 1e6:.0f} us"
        fits = p90 < PERIOD * 1e6
        return fits, text if fits else f"{text}; real time takes one per {PERIOD * 1e6:.0f} us"

    def _determinism(self) -> tuple[bool, str]:
        again = self._desk(range(DESK_SAMPLES), UP_AND_DOWN)
        other = next((n for n, pair in enumerate(zip(self._first, again, strict=True)) if pair[0] != pair[1]), None)
        if other is None:
            return True, f"the same inputs give the same bits, {DESK_SAMPLES} samples"
        return False, f"the same inputs give another answer from sample {other} on"

    def _restart(self) -> tuple[bool, str]:
        began = time.monotonic()
        self._desk(range(700), UP_AND_DOWN)  # ended in the middle of a shift
        again = self._desk(range(700), UP_AND_DOWN)
        if again != self._first[:700]:
            return False, "after an end in the middle of a shift it begins otherwise than before"
        seconds = (time.monotonic() - began) / 2
        return True, f"ended in the middle of a shift it begins anew, {seconds:.1f} s with the run"

    def _late_start(self) -> tuple[bool, str]:
        first = 12_345
        late = self._desk(range(first, first + 1500), {sample + first: gear for sample, gear in UP_AND_DOWN.items()})
        same = late[-1].gear == self._first[1499].gear and late[-1].shifting == self._first[1499].shifting
        return same, (
            f"a first sample of number {first} is taken as the first"
            if same
            else f"with a first sample of number {first} it is in gear {late[-1].gear} where it was in {self._first[1499].gear}"
        )

    def _lost_samples(self) -> tuple[bool, str]:
        samples = [n for n in range(DESK_SAMPLES) if not 1700 <= n < 1720 and n % 501]
        seen = self._desk(samples, UP_AND_DOWN)
        if (seen[-1].gear, seen[-1].shifting) != (self._first[-1].gear, self._first[-1].shifting):
            return False, f"with samples missing it ends in gear {seen[-1].gear}, not {self._first[-1].gear}"
        return True, "20 samples missing in a shift, and others alone: it ends in the same gear"

    def _nan(self) -> tuple[bool, str]:
        def broken(sample: int, wires: Wires) -> Wires:
            if not 1700 <= sample < 1750:
                return wires
            return Wires((math.nan,) * len(wires.current), (math.nan,) * len(wires.measured))

        try:
            self._desk(range(3000), UP_AND_DOWN, broken)
        except ControllerFailed as failure:
            trips = failure.status == Status.ERROR or "status fatal" in str(failure)
            return trips, f"measurements that are no numbers {'trip the rig' if trips else 'break it'}: {failure}"
        return True, "measurements that are no numbers for 50 samples do not spoil what it returns"

    def _saturation(self) -> tuple[bool, str]:
        outputs, transducers = self._record.outputs, self._record.transducers
        high = Wires(tuple(output.current.high for output in outputs), tuple(signal.high for signal in transducers))
        low = Wires((-0.01,) * len(outputs), tuple(signal.low for signal in transducers))
        for end in (high, low):
            self._desk(range(3000), UP_AND_DOWN, lambda sample, wires, end=end: end)
        return True, "all transducers at either end of their range: every value stays in its range"

    def _both_gears(self) -> tuple[bool, str]:
        plug, box = self._load(), self.config.transmission
        first, *others = box.ratios
        try:
            # what the controller does is judged here; a trip of the machine would only end it earlier
            rig = Rig(with_overrides(self.config, {"trips.watched": "off"}), controller="external", level=plug.level)
            rig.set("oil", 4.0e6, True)
            text = []
            for gear in (first, *others, first, NEUTRAL):
                if gear == first and not text:
                    rig.set("motor", 30.0, True)
                self._run(rig, plug, 0.3)
                plug.order(gear)
                began = rig.time
                while (plug.gear, plug.shifting, locked(rig, box)) != (gear, False, box.engaged(gear)):
                    if rig.time - began > SHIFT:
                        held, expected = (
                            " and ".join(clutch.name for clutch in clutches) or "no clutch"
                            for clutches in (locked(rig, box), box.engaged(gear))
                        )
                        return False, (
                            f"{SHIFT:g} s after the order of gear {box.names[gear]} it reports gear "
                            f"{box.names[plug.gear]}{', shifting' if plug.shifting else ''}, and {held} "
                            f"is locked; expected {expected}"
                        )
                    self._run(rig, plug, PERIOD)
                text.append(f"{box.names[gear]} in {rig.time - began:.2f} s")
            return True, f"on the rig: {', '.join(text)}"
        finally:
            self._close(plug)

    @staticmethod
    def _run(rig: Rig, plug: Plug, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD)):
            advance_with(rig, plug)
            rig.check_runs()

    def _storm(self) -> tuple[bool, str]:
        orders = dict(zip(range(100, 3000, 7), itertools.cycle(STORM)))
        orders.update(dict.fromkeys(range(3000, 8000, 50), 1))
        seen = self._desk(range(8000), orders)[-1]
        if (seen.gear, seen.shifting) != (1, False):
            still = ", shifting" * seen.shifting
            return False, f"after 3 s of orders and 5 s of peace it is in gear {seen.gear}{still}"
        return True, "an order every 7 ms for 3 s: it ends in the gear of the last"

    def _ends(self) -> tuple[bool, str]:
        faults = [fault for fault in self._ended if fault]
        if faults:
            return False, f"{faults[0]}; {len(faults)} of {len(self._ended)} ends"
        gone = f"; {self._abandoned} times there was nothing to end after a fatal fault" if self._abandoned else ""
        return True, f"ended {len(self._ended)} times, each in order{gone}"
