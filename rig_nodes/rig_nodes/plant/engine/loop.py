# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The one compiled entry of all rigs: it advances plant, instruments and embedded controller together in a fixed order.

Called by runs.rig_base only. It changes one record, the world, and the arrays of the gauges, of the law and of the ring of
rows; it allocates nothing and holds no lock.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...base.clocks import TICK_SAMPLES
from ...base.compiled import INLINED, INNER, njit
from ...driveline.algebra import KIN1, N_CAPPED
from ..alfa46_law import OFF, current_loop, law_step
from ..instruments import transducers
from ..parts.part import NOWHERE
from ..parts.proportional_valve import BY_LAW, BY_SETPOINT
from .outcome import NOT_FINITE, NOT_SETTLED, WHOLE
from .stages import command, fill, ordered, pickup
from .step import plant_step

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from ...base.arrays import Floats, Ints, Record

EXPONENT = 0x7FF << 52  # exponent bits of a double that is read as an integer: all are set where the number is not finite


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
def put_command(commands: Floats, place: int, outputs: Record, state: Record) -> None:
    """Write the law's command to a row of the ring: gear, 1 while it shifts, duty of each output, setpoint of each output [A]."""
    commands[place, 0] = state.gear
    commands[place, 1] = 1.0 if state.sample < state.shift_end else 0.0
    count = outputs.shape[0]
    for k in range(count):
        commands[place, 2 + k] = outputs[k].duty
        commands[place, 2 + count + k] = outputs[k].setpoint


@njit(**INLINED)
def put_moment(moments: Ints, capacities: Floats, place: int, moved: Ints, world: Record) -> None:
    """Write the present state to a row of the rings."""
    for i in range(moments.shape[1]):
        moments[place, i] = moved[i]
    for f in range(capacities.shape[1]):
        capacities[place, f] = world.driveline.cap[KIN1, f]


@njit(**INNER)
def power_stage(row: Floats, world: Record, outputs: Record, config: Record) -> None:
    """Run the plant's current driver for controllers that return setpoints: the current loop of the Alfa46 for each output.

    Parameters
    ----------
    row : array of float
        Logger row with the coil currents.
    world : Record
        The world.
    outputs : record array
        Outputs with the setpoints, in which the duties are set.
    config : Record
        Record of plant.alfa46_law.LAW_CONFIG.
    """
    for k in range(world.channel.shape[0]):
        if world.channel[k] != NOWHERE:
            world.current[k] = row[world.channel[k]]
        out = outputs[k]
        current_loop(out.phase != OFF and world.safe == 0.0, world.current[k], out, config)


@njit(cache=True, error_model="numpy")
def first_row(
    log: Floats,
    h: float,
    worlds: Record,
    numbers: Floats,
    showns: Record,
    table: Floats,
    keys: npt.NDArray[np.uint64],
    hum: Floats,
    state: Floats,
    counts: Floats,
) -> None:
    """Write the logger's row of time 0."""
    shown = showns[0]
    transducers.take(shown, table, keys, state)
    shown.mains = hum[0]
    for e in range(shown.encoder.shape[0]):
        shown.counted[shown.encoder[e]] = 0.0
    true_row(numbers, shown)
    measure(int(0), h, worlds[0], shown)  # int(): a literal would make numba compile the function once more
    for e in range(shown.encoder.shape[0]):
        counts[0, shown.encoder[e]] = shown.counted[shown.encoder[e]]
    put_row(log, int(0), shown)
    transducers.give(shown, state)


@njit(**INNER)
def put_back(world: Record, moved: Ints, kept: Ints) -> None:
    """Restore the state at the sample's beginning, and copy the discarded state into ``kept``."""
    for i in range(kept.shape[1]):
        kept[1, i] = moved[i]
        moved[i] = kept[0, i]
    world.driveline.work[:] = 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def advance(
    samples: int,
    first_sample: int,
    steps_per_sample: int,
    h: float,
    drive: int,
    addresses: tuple[int, int, int, int],
    worlds: Record,
    numbers: Floats,
    showns: Record,
    table: Floats,
    keys: npt.NDArray[np.uint64],
    hum: Floats,
    gauge_state: Floats,
    counts: Floats,
    law_config: Record,
    law_profiles: Floats,
    law_outputs: Record,
    law_state: Record,
    commands: Floats,
    moments: Ints,
    capacities: Floats,
    log: Floats,
    moved: Ints,
    finite: int,
    kept: Ints,
) -> tuple[int, int]:
    """Advance everything by whole controller samples; row j of the ring ``log`` belongs to the time j * h.

    The call ends early with the sample in which something went wrong. After a sample with a value that is not finite, the plant has
    the state of the sample's beginning, and the sample's rows show that state.

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
    steps_per_sample : int
        Steps in a sample.
    h : float
        Length of a step [s].
    drive : int
        BY_DUTY, BY_LAW or BY_SETPOINT.
    addresses : tuple of int
        Addresses of the driveline's steps, from plant.engine.general_step.
    worlds : (1,) record array
        The world.
    numbers, moved : arrays of float64 and of int64
        The beginning of ``worlds``, as two types.
    showns, table, keys, hum, gauge_state, counts : arrays
        Arrays of the gauges.
    law_config, law_profiles, law_outputs, law_state : arrays
        Arrays of the law.
    commands : (samples, 2 + 2 outputs) array of float
        Ring of the law's commands: :func:`put_command` writes the row of each sample that the law answers.
    moments, capacities : (ticks, count) array of int64, (ticks, elements) array of float
        Rings with ``moved`` at each tick of the graph, and with the capacities of the driveline's elements then.
    log : (rows, channels) array of float
        Ring of logger rows.
    finite : int
        How many of the first ``numbers`` must be finite.
    kept : (2, count) array of int64
        Copy of ``moved`` at the sample's beginning, and the state that was not finite.

    Returns
    -------
    tuple of int
        The sample that was reached, and WHOLE, NOT_FINITE or NOT_SETTLED.
    """
    rows, first, gate = log.shape[0], first_sample * steps_per_sample, counts.shape[0]
    newest, mains, slot = first % rows, first % hum.shape[0], first % gate
    world, shown = worlds[0], showns[0]
    fill(world, h)
    transducers.take(shown, table, keys, gauge_state)
    capped, how, reached = world.driveline.count[N_CAPPED], WHOLE, first_sample
    for s in range(first_sample, first_sample + samples):
        if drive == BY_SETPOINT and s > 0:
            power_stage(log[((s - 1) * steps_per_sample) % rows], world, law_outputs, law_config[0])
        command(world, law_outputs, drive)
        if drive == BY_LAW:
            for k in range(world.channel.shape[0]):
                if world.channel[k] != NOWHERE:
                    world.current[k] = log[newest, world.channel[k]]
            law_step(s, world.current, law_config[0], law_profiles, law_outputs, law_state[0])
            put_command(commands, s % commands.shape[0], law_outputs, law_state[0])
        ordered(world, law_outputs, steps_per_sample, h)
        for i in range(kept.shape[1]):
            kept[0, i] = moved[i]
        for index in range(s * steps_per_sample, (s + 1) * steps_per_sample):
            if how == WHOLE:
                plant_step(world, addresses, h, index * h)
            if not true_row(numbers, shown) and how == WHOLE:
                # the states of the gauges would keep a value that is not finite
                how = NOT_FINITE
                put_back(world, moved, kept)
                true_row(numbers, shown)
            newest = newest + 1 if newest + 1 < rows else 0
            mains = mains + 1 if mains + 1 < hum.shape[0] else 0
            slot = slot + 1 if slot + 1 < gate else 0
            # no arrays are passed to the functions called here, because a call counts the references of its arrays up and down
            shown.mains = hum[mains]
            for e in range(shown.encoder.shape[0]):
                begun = slot - int(shown.table[transducers.GATE, shown.encoder[e]])  # row at which its gate began, in the ring
                shown.counted[shown.encoder[e]] = counts[begun if begun >= 0 else begun + gate, shown.encoder[e]]
            measure(index + 1, h, world, shown)
            for e in range(shown.encoder.shape[0]):
                counts[slot, shown.encoder[e]] = shown.counted[shown.encoder[e]]
            put_row(log, newest, shown)
        reached = s + 1
        if how == WHOLE:
            wrong = 0
            for i in range(finite):
                wrong |= (moved[i] & EXPONENT) == EXPONENT
            if wrong:
                how = NOT_FINITE
                put_back(world, moved, kept)
            elif world.driveline.count[N_CAPPED] != capped:
                how = NOT_SETTLED
        if reached % TICK_SAMPLES == 0:
            put_moment(moments, capacities, (reached // TICK_SAMPLES) % moments.shape[0], moved, world)
        if how != WHOLE:
            break
    transducers.give(shown, gauge_state)
    return reached, how
