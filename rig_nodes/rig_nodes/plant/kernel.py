# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The one compiled entry: plant, instruments and embedded controller, moved together in fixed order.

Called by testbench.rig only. All it moves is one record, WORLD, beside the gauges' arrays, the law's and the ring of
rows: it allocates nothing and holds no lock, and in one record the compiler sees which values cannot be the same ones.
"""

from __future__ import annotations

from dataclasses import fields
from math import exp, inf

import numpy as np
from numba import njit

from ..alfa46.law import OFF, ON, OUTPUTS, current_loop, law_step
from ..compiled import load_numba
from ..config.schema import record_dtype
from ..instruments import transducers
from . import clutch as clutch_model
from . import gearbox as gearbox_model
from . import load_pump, oil_supply
from . import motor as motor_model
from . import valve as valve_model
from .driveline_algebra import E_FRIC, E_VISC, HI0, HI1, KIN0, KIN1, LAM, LO0, LO1, N_CAPPED, VISC, work_size
from .driveline_kernel import driveline_step
from .driveline_losses import BASE, FACTOR, loss_width
from .driveline_quiet import quiet_step
from .gearbox import LOAD, LOSS_IN, LOSS_OUT, OWN, S1, WAYS
from .outcome import NOT_FINITE, NOT_SETTLED, WHOLE
from .prescribed import Force

load_numba()
VALVES = 2
EXPONENT = 0x7FF << 52  # of a double whose bits are read as an integer: all set where it is no finite number
LEAST_LOSS = 1e-9  # Nm: what may brake as soon as a torque comes is never open
# columns of the logger's rows; the signal catalogue must agree (testbench.rig checks it). U is no transducer's: share
# of the supply voltage on the coil, in this step
CHANNELS = ("M_wej", "n_wej", "M_wyj", "n_wyj", "p1", "p2", "p_po", "I_zr_p1", "I_zr_p2", "p_p", "T_oil",
            "U_zr_p1", "U_zr_p2")
M_WEJ, N_WEJ, M_WYJ, N_WYJ, P_1, P_2, P_PO, I_1, I_2, P_P, T_OIL, U_1, U_2 = range(len(CHANNELS))
ENCODERS = (N_WEJ, N_WYJ)
# who drives the coils: duty from outside, the embedded law, or the plant's power stage on setpoints from outside
BY_DUTY, BY_LAW, BY_SETPOINT = range(3)

# work: given to the port since time 0; cut > 0: the valve but for its coil stands outside (plant.cut), and
# cut_* is its answer
VALVE_STATE = np.dtype([
    ("duty", "f8"), ("on", "f8"), ("pending", "f8"), ("current", "f8"), ("magnet", "f8"), ("spool", "f8"),
    ("flow", "f8"), ("share", "f8"), ("work", "f8"), ("cut", "f8"), ("cut_flow", "f8"),
    ("cut_slope", "f8"), ("cut_pressure", "f8"),
])
# rise: of a pressure in the last step; speed: of the piston
CLUTCH_STATE = np.dtype([
    ("line", "f8"), ("line_rise", "f8"), ("chamber", "f8"), ("chamber_rise", "f8"), ("piston", "f8"), ("speed", "f8"),
    ("clamp", "f8"), ("held", "f8"), ("rest", "f8"), ("kinetic", "f8"), ("static", "f8"), ("drag", "f8"),
    ("temperature", "f8"), ("wear", "f8"), ("heat", "f8"),
])
# what of the thesis's error sources acts here; the others are parameters. bounded: the output speed by both gears,
# only in chapter 9's simulation. pwm: frequency, 0 where it is averaged; pulses: of the coils' voltage as the
# transducers pick it up, there also where the plant takes the average
EFFECTS = np.dtype([("current_loop", "f8"), ("motor_speed", "f8"), ("pwm", "f8"), ("pulses", "f8"),
                    ("prescribed", "f8"), ("bounded", "f8"), ("loss_driving", "f8"), ("transducers", "f8")])
# gain: of a speed in the last step
PLANT_STATE = np.dtype([
    ("motor_torque", "f8"), ("motor_integral", "f8"), ("motor_setpoint", "f8"), ("supply", "f8"),
    ("load_pressure", "f8"), ("m_wej", "f8"), ("m_wyj", "f8"), ("loss_in", "f8"), ("loss_out", "f8"),
    ("gain_in", "f8"), ("gain_out", "f8"),
])
# answers of a motor and a load outside the plant (plant.cut), held for a tick; motor, load > 0: it is there
HELD = np.dtype([
    ("motor", "f8"), ("motor_torque", "f8"), ("motor_setpoint", "f8"),
    ("load", "f8"), ("load_capacity", "f8"), ("load_pressure", "f8"),
])
# what people, the sequencer and the safe state set
SETTINGS = np.dtype([
    ("motor_speed", "f8"), ("motor_on", "f8"), ("load_pressure", "f8"), ("load_on", "f8"), ("oil_pressure", "f8"),
    ("oil_on", "f8"), ("safe", "f8"),
])
# a clutch's values that testbench.rig works out of those that are given
CLUTCH_DERIVED = ("engaging_kinetic", "engaging_static", "releasing_static", "sliding_share", "drag_factor",
                  "new_clearance", *(field.name for field in fields(Force)))
CLUTCH = np.dtype(record_dtype(clutch_model.Cylinder, clutch_model.PlatePack).descr
                  + [(name, "f8") for name in CLUTCH_DERIVED])
# share of a first-order part's way that is left after a step; stiffness: of each clutch's oil in such a step; plates:
# of clutch.plates_cooling
DECAYS = np.dtype([("stiffness", "f8", (VALVES, 3)), ("plates", "f8", (VALVES, 2)), ("coil", "f8", (VALVES,)),
                   ("spool", "f8", (VALVES,)), ("supply", "f8"), ("load", "f8"), ("motor", "f8")])
# sizes of gearbox.build_driveline: speeds, friction elements, no shafts; how many events are kept
SPEEDS, ELEMENTS, SHAFTS, EVENTS = 2, 5, 0, 256
# arguments of driveline_kernel.driveline_step, those that a step changes first
DRIVELINE = np.dtype([
    ("v", "f8", (SPEEDS,)), ("el", "f8", (4, ELEMENTS)), ("e_in", "f8", (SPEEDS,)),
    ("loss", "f8", (2, loss_width(SPEEDS, ELEMENTS))), ("mode", "i8", (ELEMENTS,)),
    ("minv", "f8", (SPEEDS, SPEEDS)), ("w", "f8", (ELEMENTS, SPEEDS)), ("sh", "f8", (SHAFTS, SPEEDS)),
    ("kc", "f8", (2, SHAFTS)), ("q", "f8", (2, SPEEDS)), ("cap", "f8", (7, ELEMENTS)),
    ("twist", "f8", (SHAFTS,)), ("shaft", "f8", (2, SHAFTS)),
    ("events", "f8", (EVENTS, 3)), ("count", "i8", (2,)), ("work", "f8", (work_size(SPEEDS, ELEMENTS, SHAFTS),)),
])
# everything that the plant reads and moves; curves: the lines' pressures where they are prescribed. Its beginning, up
# to and with the driveline's modes, is what a step leaves to the next one; all of it before the modes must be finite
WORLD = np.dtype([
    ("settings", SETTINGS), ("valves", VALVE_STATE, (VALVES,)), ("cylinders", CLUTCH_STATE, (VALVES,)),
    ("plant", PLANT_STATE), ("held", HELD), ("driveline", DRIVELINE), ("curves", "f8", (VALVES,)),
    ("motor", record_dtype(motor_model.MotorConfig)), ("gearbox", record_dtype(gearbox_model.GearboxConfig)),
    ("oil", record_dtype(oil_supply.OilSupplyConfig)), ("load", record_dtype(load_pump.LoadConfig)),
    ("valve_parameters", record_dtype(valve_model.ValveConfig), (VALVES,)), ("clutches", CLUTCH, (VALVES,)),
    ("effects", EFFECTS), ("decays", DECAYS), ("wiring", "i8", (VALVES,)), ("currents", "f8", (OUTPUTS,)),
])


@njit(cache=True, error_model="numpy", forceinline=True)
def fill_decays(world, h):
    """What the step's length makes of the time constants and of the oil's."""
    decays = world.decays
    for k in range(VALVES):
        decays.coil[k] = valve_model.coil_decay(h, world.valve_parameters[k])
        decays.spool[k] = valve_model.spool_decay(h, world.valve_parameters[k])
        decays.stiffness[k, 0], decays.stiffness[k, 1], decays.stiffness[k, 2] = clutch_model.oil_stiffness(
            h, world.oil, world.clutches[k])
        decays.plates[k, 0], decays.plates[k, 1] = clutch_model.plates_cooling(h, world.clutches[k])
    decays.supply = exp(-h / world.oil.pressure_time)
    decays.load = exp(-h / world.load.pressure_time)
    decays.motor = exp(-h / world.motor.torque_time)


@njit(cache=True, error_model="numpy", forceinline=True)
def clutch_capacity(valve, cylinder, t, h, supply, oil, valve_parameters, clutch, effects, curve, coil_decay,
                    spool_decay, full_line, stiff_chamber, inertia_drop):
    """One valve and clutch from t over h: coil, spool, line, chamber, piston, pack; leaves capacities in ``cylinder``.

    ``curve``: the line's pressure where it is prescribed, which leaves out all before the pack.
    """
    if effects.prescribed > 0.0:
        cylinder.line = cylinder.chamber = curve
        cylinder.clamp = clutch_model.prescribed_clamp(curve, clutch)
        cylinder.piston = clutch.clearance if cylinder.clamp > 0.0 else 0.0
    else:
        valve.on = valve.duty if effects.pwm == 0.0 else valve_model.on_share(t, h, valve.duty, effects.pwm)
        before = valve.current
        if effects.current_loop > 0.0:
            valve.current = valve_model.coil_after(valve.current, valve.on, coil_decay, valve_parameters)
        if valve.cut == 0.0:
            # in the middle of the step: the current as it was, the port's pressure as it has been going
            valve.magnet = valve_model.magnet_pressure(valve.magnet, 0.5 * (before + valve.current), valve_parameters)
            valve.spool = valve_model.spool_after(
                valve.spool, valve.magnet, cylinder.line + 0.5 * cylinder.line_rise, spool_decay, valve_parameters)
            valve.share = valve_model.opening(valve.spool, valve_parameters)
        clutch.clearance = clutch.new_clearance + cylinder.wear
        line, chamber, piston, speed, flow = clutch_model.cylinder_step(
            cylinder, valve, supply, h, full_line, stiff_chamber, inertia_drop, oil, valve_parameters, clutch)
        valve.flow = flow
        valve.work += line * flow * h
        cylinder.line_rise, cylinder.chamber_rise = line - cylinder.line, chamber - cylinder.chamber
        cylinder.line, cylinder.chamber, cylinder.piston, cylinder.speed = line, chamber, piston, speed
        cylinder.clamp = clutch_model.pack_force(piston, clutch)[0]
    cylinder.held = clutch_model.held_torque(
        cylinder.held, cylinder.clamp, clutch.engaging_static, clutch.releasing_static)
    cylinder.rest = clutch_model.rest_share(cylinder.rest, cylinder.piston, cylinder.clamp, clutch)
    rest = clutch.rest_torque * cylinder.rest
    factor = clutch_model.friction_factor(cylinder.temperature, clutch)
    # sliding breaks the adhesion; the waves' force is the clamp itself until the piston has left them alone. What the
    # splines hold back presses the plates whether they slip or not
    cylinder.kinetic = max(factor * clutch.engaging_kinetic * cylinder.clamp, clutch.rest_sliding * rest)
    cylinder.kinetic += factor * clutch.sliding_share * (cylinder.held - clutch.engaging_static * cylinder.clamp)
    cylinder.static = factor * cylinder.held + rest
    viscosity = oil_supply.viscosity_at(cylinder.temperature, oil)
    cylinder.drag = clutch_model.drag_coefficient(cylinder.piston, cylinder.clamp, viscosity, clutch)


@njit(cache=True, error_model="numpy", forceinline=True)
def true_row(world, shown):
    """The values at the end of a step into the row of ``shown``; False where one is no finite number."""
    valves, cylinders, plant, v = world.valves, world.cylinders, world.plant, world.driveline.v
    true = shown.row
    true[M_WEJ], true[M_WYJ] = plant.m_wej, plant.m_wyj
    true[N_WEJ], true[N_WYJ] = v[0], v[1]
    true[P_1], true[P_2] = cylinders[0].line, cylinders[1].line
    true[P_PO], true[P_P] = plant.load_pressure, plant.supply
    true[I_1], true[I_2] = valves[0].current, valves[1].current
    true[T_OIL] = world.oil.temperature
    true[U_1], true[U_2] = valves[0].on, valves[1].on
    wrong = 0
    for c in range(transducers.LANES):
        wrong += 0 if abs(true[c]) < inf else 1
    return wrong == 0


@njit(cache=True, error_model="numpy", forceinline=True)
def measure(index, h, world, shown):
    """One logger row of a true one: as transducers, encoders and converter show it.

    shown: record of instruments.transducers.SHOWN, with the true row, its hum and the encoders' counters a gate ago.
    """
    valves = world.valves
    if world.effects.transducers > 0.0:
        if shown.pickup > 0.0:
            for k in range(VALVES):
                duty = valves[k].duty  # nothing is induced by the mean
                on = valve_model.on_share((index - 1) * h, h, duty, world.effects.pulses) if duty > 0.0 else 0.0
                shown.induced[P_1 + k] = on - duty
        for c in ENCODERS:
            transducers.encode(shown, c, index)
        transducers.show(shown, index)


@njit(cache=True, error_model="numpy", forceinline=True)
def plant_step(world, h, t):
    """The plant from t to t + h: hydraulics first, then the driveline between the old and the new capacities."""
    settings, valves, cylinders, plant, held = world.settings, world.valves, world.cylinders, world.plant, world.held
    effects, decays, clutches, gearbox = world.effects, world.decays, world.clutches, world.gearbox
    line = world.driveline
    cap, el, q, v, w, minv, loss = line.cap, line.el, line.q, line.v, line.w, line.minv, line.loss
    drawn = max(0.0, valves[0].flow) + max(0.0, valves[1].flow)  # what a valve lets out goes to the tank
    plant.supply = oil_supply.supply_after(
        plant.supply, settings.oil_pressure, settings.oil_on > 0.0, drawn, decays.supply, world.oil)
    for k in range(VALVES):
        f = S1 + k
        cap[KIN0, f], cap[HI0, f], drag = cylinders[k].kinetic, cylinders[k].static, cylinders[k].drag
        clutch_capacity(valves[k], cylinders[k], t, h, plant.supply, world.oil, world.valve_parameters[k], clutches[k],
                        effects, world.curves[k], decays.coil[k], decays.spool[k], decays.stiffness[k, 0],
                        decays.stiffness[k, 1], decays.stiffness[k, 2])
        cap[KIN1, f], cap[HI1, f] = cylinders[k].kinetic, cylinders[k].static
        cap[LO0, f], cap[LO1, f] = -cap[HI0, f], -cap[HI1, f]
        cap[VISC, f] = 0.5 * (drag + cylinders[k].drag)

    # speeds in the middle of the step, as they have been going
    middle_in, middle_out = v[0] + 0.5 * plant.gain_in, v[1] + 0.5 * plant.gain_out
    old_in, old_out = v[0], v[1]
    drive = settings.motor_on > 0.0 and settings.safe == 0.0
    if effects.motor_speed == 0.0:
        # w0 is so heavy here (testbench.rig) that no clutch is felt; it is pushed to the setpoint of the step's end
        before = plant.motor_setpoint
        plant.motor_setpoint = motor_model.next_setpoint(before, settings.motor_speed, v[0], drive, h, world.motor)
        q[0, 0] = plant.motor_torque = (plant.motor_setpoint - v[0]) / (minv[0, 0] * h) if drive else 0.0
    elif held.motor > 0.0:
        plant.motor_setpoint = held.motor_setpoint
        plant.motor_torque = held.motor_torque if settings.safe == 0.0 else 0.0
        q[0, 0] = plant.motor_torque
    else:
        before = plant.motor_setpoint
        plant.motor_setpoint = motor_model.next_setpoint(before, settings.motor_speed, v[0], drive, h, world.motor)
        q[0, 0] = plant.motor_torque if drive else 0.0
        plant.motor_torque, plant.motor_integral = motor_model.torque_after(
            plant.motor_torque, plant.motor_integral, 0.5 * (before + plant.motor_setpoint), middle_in, drive, h,
            decays.motor, world.motor)
    q[1, 0] = plant.motor_torque

    load_before = cap[KIN1, LOAD]
    # losses and load resist: friction elements to ground, so they can hold a shaft but never turn it
    if held.load > 0.0:
        plant.load_pressure = held.load_pressure
        cap[KIN1, LOAD] = max(0.0, held.load_capacity)
    else:
        plant.load_pressure = load_pump.pressure_after(
            plant.load_pressure, settings.load_pressure, settings.load_on > 0.0, middle_out, decays.load, world.load)
        cap[KIN1, LOAD] = load_pump.torque_capacity(plant.load_pressure, world.load)
    cap[KIN0, LOAD], cap[HI0, LOAD], cap[LO0, LOAD] = load_before, load_before, -load_before
    cap[HI1, LOAD], cap[LO1, LOAD] = cap[KIN1, LOAD], -cap[KIN1, LOAD]
    # by speed, held over the step; what comes by torque is the driveline's to solve
    loss[0, BASE] = max(LEAST_LOSS, gearbox_model.loss_in(middle_in, gearbox))
    loss[1, BASE] = max(LEAST_LOSS, gearbox_model.loss_out(gearbox))
    if effects.loss_driving > 0.0:  # the same power on the other shaft
        loss[1, FACTOR] = min(1.0, max(0.0, middle_out / middle_in)) if middle_in > 1.0 else 0.0

    if not quiet_step(h, minv, w, q, cap, loss, v, line.mode, el, line.e_in, line.work, OWN, WAYS):
        driveline_step(h, t, minv, w, line.sh, line.kc, q, cap, loss, v, line.twist, line.mode, el, line.shaft,
                       line.e_in, line.events, line.count, line.work)
    plant.loss_in, plant.loss_out = cap[KIN1, LOSS_IN], cap[KIN1, LOSS_OUT]
    if effects.bounded > 0.0:
        # as an integrator with limits: no slip of S1 against the drive, none of S2 with it
        v[1] = min(max(v[1], -v[0] * w[S1, 0] / w[S1, 1]), -v[0] * w[S1 + 1, 0] / w[S1 + 1, 1])
    plant.gain_in, plant.gain_out = v[0] - old_in, v[1] - old_out
    for k in range(VALVES):
        cylinder, heat = cylinders[k], el[E_FRIC, S1 + k] + el[E_VISC, S1 + k]
        cylinder.temperature, cylinder.wear = clutch_model.plates_after(
            cylinder.temperature, cylinder.wear, heat - cylinder.heat, world.oil.temperature, decays.plates[k, 0],
            decays.plates[k, 1], clutches[k])
        cylinder.heat = heat
    # the torque meters sit between motor and gearbox and between gearbox and pump: accelerations at the end of the step
    on_in, on_out = q[1, 0], 0.0
    for f in range(ELEMENTS):
        torque = el[LAM, f] + cap[VISC, f] * (w[f, 0] * v[0] + w[f, 1] * v[1])
        on_in -= w[f, 0] * torque
        on_out -= w[f, 1] * torque
    if effects.motor_speed == 0.0:
        plant.m_wej = w[S1, 0] * el[LAM, S1] + w[S1 + 1, 0] * el[LAM, S1 + 1] + plant.loss_in  # (6.82)
        # what gives the rig's own inertia this speed; q also turns what was put on w0
        plant.motor_torque = gearbox.inertia_in * plant.gain_in / h + (q[1, 0] - on_in)
    else:
        outside = gearbox.inertia_in - gearbox.inertia_in_gearbox
        plant.m_wej = q[1, 0] - outside * on_in / gearbox.inertia_in
    plant.m_wyj = el[LAM, LOAD] + gearbox.inertia_pump * minv[1, 1] * on_out


@njit(cache=True, error_model="numpy")
def prescribed_pressure(since, phase, pieces):
    """Pressure [Pa] ``since`` s after the switch signal of a valve's phase; none before the first.

    pieces (2, n, 5): for switching on and off, rows of end [s] and the coefficients of a cubic [Pa, s], lowest power
    first; a row without end is the last one.
    """
    if phase == OFF:
        return 0.0
    rows = pieces[0] if phase == ON else pieces[1]
    for row in range(rows.shape[0]):
        if since <= rows[row, 0]:
            p = rows[row, 1] + since * (rows[row, 2] + since * (rows[row, 3] + since * rows[row, 4]))
            return max(0.0, p)
    return 0.0


@njit(cache=True, error_model="numpy")
def power_stage(row, safe, wiring, currents, outputs, config):
    """The plant's current driver, for controllers that return setpoints: the box's current loop for each output.

    Reads the coil currents of the logger row ``row`` and the setpoints in ``outputs``; leaves its duty there.
    """
    for k in range(VALVES):
        currents[wiring[k]] = row[I_1 + k]
    for k in range(OUTPUTS):
        out = outputs[k]
        current_loop(out.phase != OFF and not safe, currents[k], out, config)


@njit(cache=True, error_model="numpy")
def first_row(log, h, worlds, showns, table, keys, hum, state, counts):
    """The logger's row of time 0."""
    shown = showns[0]
    transducers.take(shown, table, keys, state)
    shown.mains = hum[0]
    for c in ENCODERS:
        shown.counted[c] = 0.0
    true_row(worlds[0], shown)
    measure(int(0), h, worlds[0], shown)  # int(): a literal would have it compiled once more
    for c in ENCODERS:
        counts[0, c] = shown.counted[c]
    for c in range(len(CHANNELS)):
        log[0, c] = shown.row[c]
    transducers.give(shown, state)


@njit(cache=True, error_model="numpy", forceinline=False)
def put_back(world, moved, kept):
    """The state of the sample's beginning, the one that is given up into ``kept``."""
    for i in range(moved.size):
        kept[1, i] = moved[i]
        moved[i] = kept[0, i]
    world.driveline.work[:] = 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def advance(samples, first_sample, steps_per_sample, h, drive, worlds, showns, table, keys, hum, gauge_state, counts,
            law_config, law_profiles, law_outputs, law_state, log, pieces, moved, finite, kept):
    """Move everything by whole controller samples; row j of the ring ``log`` is the time j * h after 0.

    Returns (the sample that was reached, one of WHOLE, NOT_FINITE, NOT_SETTLED): it ends early with the sample in
    which something went wrong. moved: the beginning of ``worlds`` as int64, of which the first ``finite`` must be
    finite numbers; kept (2, as many): its copy at the sample's beginning, and the state that was not finite.
    Such a sample leaves the plant as it was at its beginning, and its rows show that.

    Order at each controller sample: the duty answered to the last sample is applied, then (drive BY_LAW) the law
    answers this one. So the controller acts with one sample of delay, in the kernel and outside it alike. BY_SETPOINT
    the duty is that of the power stage for the newest setpoints and the currents of the last sample, which the
    controller saw too: the same delay, wherever the current loop is closed.
    """
    rows, first = log.shape[0], first_sample * steps_per_sample
    newest, mains, slot = first % rows, first % hum.shape[0], first % counts.shape[0]
    world, shown = worlds[0], showns[0]
    settings, valves, effects = world.settings, world.valves, world.effects
    wiring, currents = world.wiring, world.currents
    fill_decays(world, h)
    transducers.take(shown, table, keys, gauge_state)
    capped, how, reached = world.driveline.count[N_CAPPED], WHOLE, first_sample
    for s in range(first_sample, first_sample + samples):
        if drive == BY_SETPOINT and s > 0:
            power_stage(log[((s - 1) * steps_per_sample) % rows], settings.safe > 0.0, wiring, currents, law_outputs,
                        law_config[0])
        if drive != BY_DUTY:
            for k in range(VALVES):
                valves[k].pending = law_outputs[wiring[k]].duty
        if effects.current_loop == 0.0:
            # the setpoint of the last sample, as the duty would be; there is none BY_DUTY, which testbench.rig refuses
            for k in range(VALVES):
                on = settings.safe == 0.0
                valves[k].current = law_outputs[wiring[k]].setpoint if on else 0.0
        if drive == BY_LAW:
            for k in range(VALVES):
                currents[wiring[k]] = log[newest, I_1 + k]
            law_step(s, currents, law_config[0], law_profiles, law_outputs, law_state[0])
        for k in range(VALVES):
            valves[k].duty = 0.0 if settings.safe > 0.0 else valves[k].pending
        for i in range(moved.size):
            kept[0, i] = moved[i]
        for index in range(s * steps_per_sample, (s + 1) * steps_per_sample):
            if effects.prescribed > 0.0:
                for k in range(VALVES):
                    out = law_outputs[wiring[k]]
                    since = (index + 1 - out.start * steps_per_sample) * h
                    world.curves[k] = prescribed_pressure(since, out.phase, pieces[k])
            if how == WHOLE:
                plant_step(world, h, index * h)
            if not true_row(world, shown) and how == WHOLE:
                # the gauges would remember it
                how = NOT_FINITE
                put_back(world, moved, kept)
                true_row(world, shown)
            newest = newest + 1 if newest + 1 < rows else 0
            mains = mains + 1 if mains + 1 < hum.shape[0] else 0
            slot = slot + 1 if slot + 1 < counts.shape[0] else 0
            # arrays stay out of what is called here: a function counts those it is given in and out
            shown.mains = hum[mains]
            for c in ENCODERS:
                shown.counted[c] = counts[slot, c]
            measure(index + 1, h, world, shown)
            for c in ENCODERS:
                counts[slot, c] = shown.counted[c]
            for c in range(len(CHANNELS)):
                log[newest, c] = shown.row[c]
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
        if how != WHOLE:
            break
    transducers.give(shown, gauge_state)
    return reached, how
