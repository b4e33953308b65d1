# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The one compiled entry of all rigs: it advances plant, instruments and embedded controller together in a fixed order.

Called by runs.rig_base only. It changes one record, the world, and the arrays of the gauges, of the law and of the ring of
rows; it allocates nothing and holds no lock.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from ...base import INLINED, INNER, TICK_SAMPLES, njit
from ...driveline import KIN1, N_CAPPED
from ..alfa46_law import OFF, current_loop, law_step
from ..instruments import transducers
from ..parts.part import NOWHERE
from ..parts.proportional_valve import BY_LAW, BY_SETPOINT
from .outcome import NOT_FINITE, NOT_SETTLED, WHOLE
from .stages import command, fill, ordered, pickup
from .step import plant_step
from .watch import Watch, watched

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from ...base import Floats, Ints, Record
    from .general_step import Addresses

EXPONENT = 0x7FF << 52  # exponent bits of a double that is read as an integer: all are set where the number is not finite


class Plant(NamedTuple):
    """The plant and how it is moved.

    Parameters
    ----------
    worlds : (1,) record array
        The world.
    numbers, moved : arrays of float64 and of int64
        Its beginning, as two types.
    finite : int
        How many of the first numbers must be finite.
    kept : (2, count) array of int64
        Copy of ``moved`` at a sample's beginning, and the state that was not finite.
    h : float
        Length of a step [s].
    steps : int
        Steps in a sample.
    addresses : Addresses
        Addresses of the driveline's steps.
    """

    worlds: Record
    numbers: Floats
    moved: Ints
    finite: int
    kept: Ints
    h: float
    steps: int
    addresses: Addresses


class GaugeArrays(NamedTuple):
    """The transducers: records of plant.instruments.transducers.shown_dtype (1,), and the arrays of runs.gauges.Gauges."""

    showns: Record
    table: Floats
    keys: npt.NDArray[np.uint64]
    hum: Floats
    state: Floats
    counts: Floats


class Law(NamedTuple):
    """The embedded controller: record arrays of plant.alfa46_law, one output each, and its profiles (outputs, 6, 2)."""

    config: Record
    profiles: Floats
    outputs: Record
    state: Record


class Rings(NamedTuple):
    """What is written down.

    Parameters
    ----------
    log : (rows, channels) array of float
        Logger rows; row j belongs to the time j * h.
    commands : (samples, 2 + 2 outputs) array of float
        Commands of the law: :func:`put_command` writes the row of each sample that it answers.
    moments : (ticks, count) array of int64
        ``Plant.moved`` at each tick of the graph.
    capacities : (ticks, elements) array of float
        Capacities of the driveline's elements then [Nm].
    """

    log: Floats
    commands: Floats
    moments: Ints
    capacities: Floats


@njit(**INLINED)
def true_row(numbers: Floats, shown: Record) -> bool:
    """Write the values at the end of a step to the row of ``shown``; return False where one is not a finite number.

    Parameters
    ----------
    numbers : array of float
        The beginning of the world; every channel shows one of its numbers.
    shown : Record
        Record of plant.instruments.transducers.shown_dtype.

    Returns
    -------
    bool
        Whether all values are finite.
    """
    nothing = 0.0  # stays 0 as long as all numbers are finite
    for c in range(shown.source.shape[0]):
        value = numbers[shown.source[c]]
        shown.row[c] = value
        nothing += value - value
    for c in range(shown.untouched.shape[0]):
        value = numbers[shown.untouched_source[c]]
        shown.untouched[c] = value
        nothing += value - value
    return nothing == 0.0


@njit(**INLINED)
def measure(index: int, h: float, world: Record, shown: Record) -> None:
    """Turn a true logger row into the row that transducers, encoders and converter show.

    Parameters
    ----------
    index : int
        Number of the row.
    h : float
        Length of a step [s].
    world : Record
        The world.
    shown : Record
        Record of plant.instruments.transducers.shown_dtype, with the true row, its hum and the encoders' counters one gate ago.
    """
    if shown.present > 0.0:
        if shown.pickup > 0.0:
            pickup(world, h, index, shown)
        for e in range(shown.encoder.shape[0]):
            transducers.encode(shown, shown.encoder[e], index)
        transducers.show(shown, index)


@njit(**INLINED)
def put_row(log: Floats, place: int, shown: Record) -> None:
    """Write the shown values to a row of the ring."""
    count = shown.source.shape[0]
    for c in range(count):
        log[place, c] = shown.row[c]
    for c in range(shown.untouched.shape[0]):
        log[place, count + c] = shown.untouched[c]


@njit(**INLINED)
def put_command(commands: Floats, sample: int, outputs: Record, state: Record) -> None:
    """Write the law's command to the row of a sample: gear, 1 while it shifts, duty and then setpoint [A] of each output."""
    place, count = sample % commands.shape[0], outputs.shape[0]
    commands[place, 0] = state.gear
    commands[place, 1] = 1.0 if state.sample < state.shift_end else 0.0
    for k in range(count):
        commands[place, 2 + k] = outputs[k].duty
        commands[place, 2 + count + k] = outputs[k].setpoint


@njit(**INLINED)
def put_moment(moments: Ints, capacities: Floats, tick: int, moved: Ints, world: Record) -> None:
    """Write the present state to the row of a tick."""
    place = tick % moments.shape[0]
    for i in range(moments.shape[1]):
        moments[place, i] = moved[i]
    for f in range(capacities.shape[1]):
        capacities[place, f] = world.driveline.cap[KIN1, f]


@njit(**INLINED)
def measured_currents(world: Record, log: Floats, row: int) -> None:
    """Set the coil currents of the outputs to those of a logger row; an output without a channel keeps its own."""
    for k in range(world.channel.shape[0]):
        if world.channel[k] != NOWHERE:
            world.current[k] = log[row, world.channel[k]]


@njit(**INNER)
def power_stage(world: Record, outputs: Record, config: Record) -> None:
    """Run the plant's current driver for controllers that return setpoints: the current loop of the Alfa46 for each output.

    Parameters
    ----------
    world : Record
        The world with the coil currents.
    outputs : record array
        Outputs with the setpoints, in which the duties are set.
    config : Record
        Record of plant.alfa46_law.LAW_CONFIG.
    """
    for k in range(world.channel.shape[0]):
        out = outputs[k]
        current_loop(out.phase != OFF and world.safe == 0.0, world.current[k], out, config)


@njit(**INNER)
def put_back(world: Record, moved: Ints, kept: Ints) -> None:
    """Restore the state at the sample's beginning, and copy the discarded state into ``kept``."""
    for i in range(kept.shape[1]):
        kept[1, i] = moved[i]
        moved[i] = kept[0, i]
    world.driveline.work[:] = 0.0


@njit(**INLINED)
def is_finite(moved: Ints, finite: int) -> bool:
    """Return whether the first numbers of the world are finite."""
    wrong = 0
    for i in range(finite):
        wrong |= (moved[i] & EXPONENT) == EXPONENT
    return not wrong


@njit(**INLINED)
def control(sample: int, drive: int, plant: Plant, law: Law, rings: Rings) -> None:
    """Apply the duty at a controller sample, and let the law or the power stage compute one; see :func:`advance`."""
    world, rows, config = plant.worlds[0], rings.log.shape[0], law.config[0]
    if sample < 0:
        return
    if drive == BY_SETPOINT and sample > 0:
        measured_currents(world, rings.log, ((sample - 1) * plant.steps) % rows)
        power_stage(world, law.outputs, config)
    command(world, law.outputs, drive)
    if drive == BY_LAW:
        measured_currents(world, rings.log, (sample * plant.steps) % rows)
        law_step(sample, world.current, config, law.profiles, law.outputs, law.state[0])
        put_command(rings.commands, sample, law.outputs, law.state[0])
    ordered(world, law.outputs, plant.steps, plant.h)


@njit(**INLINED)
def count_encoders(shown: Record, counts: Floats, slot: int) -> None:
    """Set the counter that each encoder had when its gate began, one gate before row ``slot`` of the ring of counters."""
    for e in range(shown.encoder.shape[0]):
        begun = slot - int(shown.table[transducers.GATE, shown.encoder[e]])
        shown.counted[shown.encoder[e]] = counts[begun if begun >= 0 else begun + counts.shape[0], shown.encoder[e]]


@njit(**INLINED)
def keep_encoders(shown: Record, counts: Floats, slot: int) -> None:
    """Write the counters of the encoders to a row of their ring."""
    for e in range(shown.encoder.shape[0]):
        counts[slot, shown.encoder[e]] = shown.counted[shown.encoder[e]]


@njit(**INNER)
def look(sample: int, drive: int, numbers: Floats, law: Law, shown: Record, watch: Watch) -> int:
    """Look at the trips after a sample, with what the embedded law reports if it drives; see :func:`watch.watched`.

    It is not merged into :func:`advance`, whose steps would then take 2 % longer even with nothing to look at.
    """
    if drive == BY_LAW:
        watch.said[0], watch.said[1] = law.state[0].gear, 1.0 if sample < law.state[0].shift_end else 0.0
    return watched(watch, numbers, shown.row, shown.table[transducers.NOISE])


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False)
def advance(
    samples: int, first_sample: int, drive: int, plant: Plant, gauges: GaugeArrays, law: Law, rings: Rings, watch: Watch
) -> tuple[int, int]:
    """Advance everything by whole controller samples; sample -1 has no step and no controller, but writes the row of time 0.

    The call ends early with the sample in which something went wrong, or a trip fires or warns. After one with a value that is not
    finite, the plant has the state of the sample's beginning, and the sample's rows show that state.

    Order at each controller sample: the duty computed from the last sample is applied, then (drive BY_LAW) the law computes the
    duty from this one. So the controller acts with one sample of delay, both in the engine and outside it. With BY_SETPOINT the
    power stage computes the duty from the newest setpoints and the currents of the last sample, from which the controller computed
    its setpoints too: the delay is the same, wherever the current loop is closed.

    Parameters
    ----------
    samples : int
        Number of samples.
    first_sample : int
        Number of the first one.
    drive : int
        BY_DUTY, BY_LAW or BY_SETPOINT.
    plant, gauges, law, rings, watch : Plant, GaugeArrays, Law, Rings, Watch
        What is moved, what it shows, the embedded controller, what is written down, and what trips the rig.

    Returns
    -------
    tuple of int
        The sample that was reached, and an outcome of plant.engine.outcome.
    """
    numbers, moved, kept, h, steps, hum, counts, log = (
        plant.numbers,
        plant.moved,
        plant.kept,
        plant.h,
        plant.steps,
        gauges.hum,
        gauges.counts,
        rings.log,
    )
    first = max(first_sample * steps, -1)
    newest, mains, slot = first % log.shape[0], first % hum.shape[0], first % counts.shape[0]
    world, shown = plant.worlds[0], gauges.showns[0]
    fill(world, h)
    transducers.take(shown, gauges.table, gauges.keys, gauges.state)
    capped, how, reached = world.driveline.count[N_CAPPED], WHOLE, first_sample
    for s in range(first_sample, first_sample + samples):
        control(s, drive, plant, law, rings)
        for i in range(kept.shape[1]):
            kept[0, i] = moved[i]
        for index in range(max(s * steps, -1), (s + 1) * steps):
            if how == WHOLE and s >= 0:
                plant_step(world, plant.addresses, h, index * h)
            if not true_row(numbers, shown) and how == WHOLE:
                # the states of the gauges would keep a value that is not finite
                how = NOT_FINITE
                put_back(world, moved, kept)
                true_row(numbers, shown)
            newest = newest + 1 if newest + 1 < log.shape[0] else 0
            mains = mains + 1 if mains + 1 < hum.shape[0] else 0
            slot = slot + 1 if slot + 1 < counts.shape[0] else 0
            shown.mains = hum[mains]
            count_encoders(shown, counts, slot)
            measure(index + 1, h, world, shown)
            keep_encoders(shown, counts, slot)
            put_row(log, newest, shown)
        reached = s + 1
        if how == WHOLE and s >= 0:
            if not is_finite(moved, plant.finite):
                how = NOT_FINITE
                put_back(world, moved, kept)
            elif world.driveline.count[N_CAPPED] != capped:
                how = NOT_SETTLED
            elif world.safe == 0.0:
                how = look(s, drive, numbers, law, shown, watch)
        if reached % TICK_SAMPLES == 0 and s >= 0:
            put_moment(rings.moments, rings.capacities, reached // TICK_SAMPLES, moved, world)
        if how != WHOLE:
            break
    transducers.give(shown, gauges.state)
    return reached, how
