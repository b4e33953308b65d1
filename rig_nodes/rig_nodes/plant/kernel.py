"""The one compiled entry: plant, instruments and embedded controller, moved together in fixed order.

Called by testbench.rig only. Everything it needs comes in as arrays; it allocates nothing and holds no lock.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..alfa46.law import OFF, ON, OUTPUTS, current_loop, law_step
from ..instruments.noise import noise_at
from ..instruments.transducers import HUM, NOISE, PICKUP, STEP, analog, encoder, logged
from . import clutch as clutch_model
from . import gearbox as gearbox_model
from . import load_pump, oil_supply
from . import motor as motor_model
from . import valve as valve_model
from .driveline_algebra import E_FRIC, E_VISC, HI0, HI1, KIN0, KIN1, LAM, LO0, LO1, VISC
from .driveline_kernel import driveline_step
from .gearbox import LOAD, LOSS_IN, LOSS_OUT, S1

VALVES = 2
# columns of the logger's rows; the signal catalogue must agree (testbench.rig checks it)
CHANNELS = ("M_wej", "n_wej", "M_wyj", "n_wyj", "p1", "p2", "p_po", "I_zr_p1", "I_zr_p2", "p_p", "T_oil",
            "U_zr_p1", "U_zr_p2")
M_WEJ, N_WEJ, M_WYJ, N_WYJ, P_1, P_2, P_PO, I_1, I_2, P_P, T_OIL, U_1, U_2 = range(len(CHANNELS))
SIGNALS = ("U_zr_p1", "U_zr_p2")  # no transducer's: share of the supply voltage on the coil, in this step
# who drives the coils: duty from outside, the embedded law, or the plant's power stage on setpoints from outside
BY_DUTY, BY_LAW, BY_SETPOINT = range(3)

# work: given to the port since time 0; cut > 0: the valve but for its coil stands outside (plant.cut), and
# cut_* is its answer
VALVE_STATE = np.dtype([
    ("duty", "f8"), ("on", "f8"), ("pending", "f8"), ("current", "f8"), ("magnet", "f8"), ("spool", "f8"), ("flow", "f8"), ("share", "f8"),
    ("work", "f8"), ("cut", "f8"), ("cut_flow", "f8"), ("cut_slope", "f8"), ("cut_pressure", "f8"),
])
CLUTCH_STATE = np.dtype([
    ("line", "f8"), ("chamber", "f8"), ("piston", "f8"), ("clamp", "f8"), ("held", "f8"),
    ("rest", "f8"), ("kinetic", "f8"), ("static", "f8"), ("drag", "f8"), ("temperature", "f8"), ("wear", "f8"),
    ("heat", "f8"),
])
# what of the thesis's error sources acts here; the others are parameters. pwm: frequency, 0 where it is averaged;
# pulses: of the coils' voltage as the transducers pick it up, there also where the plant takes the average
EFFECTS = np.dtype([("current_loop", "f8"), ("motor_speed", "f8"), ("pwm", "f8"), ("pulses", "f8"),
                    ("prescribed", "f8"), ("loss_driving", "f8")])
PLANT_STATE = np.dtype([
    ("motor_torque", "f8"), ("motor_integral", "f8"), ("motor_setpoint", "f8"), ("supply", "f8"),
    ("load_pressure", "f8"), ("m_wej", "f8"), ("m_wyj", "f8"), ("loss_in", "f8"), ("loss_out", "f8"),
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


@njit(cache=True)
def clutch_capacity(valve, cylinder, t, h, supply, oil, valve_parameters, clutch, effects, curve):
    """One valve and clutch from t over h: coil, spool, line, chamber, piston, pack; leaves capacities in ``cylinder``.

    ``curve``: the line's pressure where it is prescribed, which leaves out all before the pack.
    """
    if effects.prescribed > 0.0:
        cylinder.line = cylinder.chamber = curve
        cylinder.clamp = clutch_model.prescribed_clamp(curve, clutch)
        cylinder.piston = clutch.clearance if cylinder.clamp > 0.0 else 0.0
    else:
        valve.on = valve.duty if effects.pwm == 0.0 else valve_model.on_share(t, h, valve.duty, effects.pwm)
        if effects.current_loop > 0.0:
            valve.current = valve_model.coil_current(valve.current, valve.on, h, valve_parameters)
        if valve.cut == 0.0:
            valve.magnet = valve_model.magnet_pressure(valve.magnet, valve.current, valve_parameters)
            valve.spool = valve_model.spool_position(
                valve.spool, valve.magnet, cylinder.line, h, valve_parameters)
            valve.share = valve_model.opening(valve.spool, valve_parameters)
        clutch.clearance = clutch.new_clearance + cylinder.wear
        line, chamber, piston, flow = clutch_model.cylinder_step(
            cylinder.line, cylinder.chamber, cylinder.piston, valve, supply, h, oil, valve_parameters, clutch)
        valve.flow = flow
        valve.work += line * flow * h
        cylinder.line, cylinder.chamber, cylinder.piston = line, chamber, piston
        cylinder.clamp = clutch_model.pack_force(piston, clutch)[0]
    cylinder.held = clutch_model.held_torque(
        cylinder.held, cylinder.clamp, clutch.engaging_static, clutch.releasing_static)
    cylinder.rest = clutch_model.rest_share(cylinder.rest, cylinder.piston, cylinder.clamp, clutch)
    rest = clutch.rest_torque * cylinder.rest
    factor = clutch_model.friction_factor(cylinder.temperature, clutch)
    # sliding breaks the adhesion and shakes the plates loose on their splines; the waves' force is the clamp itself until
    # the piston has left them alone
    cylinder.kinetic = max(factor * clutch.engaging_kinetic * cylinder.clamp, clutch.kinetic_share * rest)
    cylinder.static = factor * cylinder.held + rest
    viscosity = oil_supply.viscosity_at(cylinder.temperature, oil)
    cylinder.drag = clutch_model.drag_coefficient(cylinder.piston, cylinder.clamp, viscosity, clutch)


@njit(cache=True)
def measure(row, index, h, v, valves, cylinders, plant, oil, effects, table, keys, hum, state, counts):
    """One logger row: true values as transducers, encoders and converter show them at the end of a step.

    table and what follows: ``arrays`` of testbench.gauges. No tuple, whose parts would be counted in and out each row.
    """
    row[M_WEJ], row[M_WYJ] = plant.m_wej, plant.m_wyj
    row[N_WEJ], row[N_WYJ] = v[0], v[1]
    row[P_1], row[P_2] = cylinders[0].line, cylinders[1].line
    row[P_PO], row[P_P] = plant.load_pressure, plant.supply
    row[I_1], row[I_2] = valves[0].current, valves[1].current
    row[T_OIL] = oil.temperature
    row[U_1], row[U_2] = valves[0].on, valves[1].on
    mains = hum[index % hum.size]
    for c in range(row.size):
        if table[STEP, c] > 0.0:
            value = encoder(row[c], index, c, keys[c], table, state, counts)
        else:
            disturbance = table[HUM, c] * mains
            if table[PICKUP, c] > 0.0:
                duty = valves[c - P_1].duty  # nothing is induced by the mean
                on = valve_model.on_share((index - 1) * h, h, duty, effects.pulses) if duty > 0.0 else 0.0
                disturbance += table[PICKUP, c] * (on - duty)
            value = analog(row[c], disturbance, c, table, state)
            if table[NOISE, c] > 0.0:
                value += table[NOISE, c] * noise_at(keys[c], index)
        row[c] = logged(value, c, table)


@njit(cache=True)
def plant_step(h, t, settings, valves, cylinders, plant, held, v, twist, mode, el, shaft, e_in, events, count,
               work, q, cap, minv, w, sh, kc, motor, gearbox, oil, load, valve_parameters, clutches, effects, curves):
    """The plant from t to t + h: hydraulics first, then the driveline between the old and the new capacities."""
    drawn = max(0.0, valves[0].flow) + max(0.0, valves[1].flow)  # what a valve lets out goes to the tank
    plant.supply = oil_supply.supply_pressure(plant.supply, settings.oil_pressure, settings.oil_on > 0.0, drawn, h, oil)
    for k in range(VALVES):
        f = S1 + k
        cap[KIN0, f], cap[HI0, f] = cylinders[k].kinetic, cylinders[k].static
        clutch_capacity(valves[k], cylinders[k], t, h, plant.supply, oil, valve_parameters[k], clutches[k], effects,
                        curves[k])
        cap[KIN1, f], cap[HI1, f] = cylinders[k].kinetic, cylinders[k].static
        cap[LO0, f], cap[LO1, f] = -cap[HI0, f], -cap[HI1, f]
        cap[VISC, f] = cylinders[k].drag

    drive = settings.motor_on > 0.0 and settings.safe == 0.0
    if effects.motor_speed == 0.0:
        # w0 is so heavy here (testbench.rig) that no clutch is felt; it is pushed to the setpoint of the step's end
        before = plant.motor_setpoint
        plant.motor_setpoint = motor_model.next_setpoint(before, settings.motor_speed, v[0], drive, h, motor)
        q[0, 0] = plant.motor_torque = (plant.motor_setpoint - v[0]) / (minv[0, 0] * h) if drive else 0.0
    elif held.motor > 0.0:
        plant.motor_setpoint = held.motor_setpoint
        plant.motor_torque = held.motor_torque if settings.safe == 0.0 else 0.0
        q[0, 0] = plant.motor_torque
    else:
        plant.motor_setpoint = motor_model.next_setpoint(
            plant.motor_setpoint, settings.motor_speed, v[0], drive, h, motor)
        q[0, 0] = plant.motor_torque if drive else 0.0
        plant.motor_torque, plant.motor_integral = motor_model.drive_torque(
            plant.motor_torque, plant.motor_integral, plant.motor_setpoint, v[0], drive, h, motor)
    q[1, 0] = plant.motor_torque

    # losses and load resist: friction elements to ground, so they can hold a shaft but never turn it
    if held.load > 0.0:
        plant.load_pressure = held.load_pressure
        cap[KIN1, LOAD] = max(0.0, held.load_capacity)
    else:
        plant.load_pressure = load_pump.line_pressure(
            plant.load_pressure, settings.load_pressure, settings.load_on > 0.0, v[1], h, load)
        cap[KIN1, LOAD] = load_pump.torque_capacity(plant.load_pressure, load)
    carried = w[S1, 0] * el[LAM, S1] + w[S1 + 1, 0] * el[LAM, S1 + 1]  # by w0 into the clutches
    plant.loss_in = gearbox_model.loss_in(v[0], carried, gearbox)
    plant.loss_out, by_load = gearbox_model.loss_out(gearbox), gearbox_model.loss_by_load(plant.m_wyj, gearbox)
    if effects.loss_driving == 0.0:
        plant.loss_out += by_load
    elif v[0] > 1.0:
        plant.loss_in += by_load * min(1.0, max(0.0, v[1] / v[0]))  # the same power on the other shaft
    cap[KIN1, LOSS_IN], cap[KIN1, LOSS_OUT] = plant.loss_in, plant.loss_out
    for f in (LOSS_IN, LOSS_OUT, LOAD):
        # held over the step: their change is slow, and one torque per step keeps work and meters consistent
        cap[KIN0, f] = cap[HI0, f] = cap[HI1, f] = cap[KIN1, f]
        cap[LO0, f] = cap[LO1, f] = -cap[KIN1, f]

    old_in, old_out = v[0], v[1]
    driveline_step(h, t, minv, w, sh, kc, q, cap, v, twist, mode, el, shaft, e_in, events, count, work)
    for k in range(VALVES):
        cylinder, heat = cylinders[k], el[E_FRIC, S1 + k] + el[E_VISC, S1 + k]
        cylinder.temperature, cylinder.wear = clutch_model.plates_after(
            cylinder.temperature, cylinder.wear, heat - cylinder.heat, oil.temperature, h, clutches[k])
        cylinder.heat = heat
    # the torque meters sit between motor and gearbox and between gearbox and pump
    if effects.motor_speed == 0.0:
        plant.m_wej = w[S1, 0] * el[LAM, S1] + w[S1 + 1, 0] * el[LAM, S1 + 1] + plant.loss_in  # (6.82)
    else:
        outside = gearbox.inertia_in - gearbox.inertia_in_gearbox
        plant.m_wej = 0.5 * (q[0, 0] + q[1, 0]) - outside * (v[0] - old_in) / h
    plant.m_wyj = el[LAM, LOAD] + gearbox.inertia_pump * (v[1] - old_out) / h


@njit(cache=True)
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


@njit(cache=True)
def power_stage(row, safe, wiring, currents, outputs, config):
    """The plant's current driver, for controllers that return setpoints: the box's current loop for each output.

    Reads the coil currents of the logger row ``row`` and the setpoints in ``outputs``; leaves its duty there.
    """
    for k in range(VALVES):
        currents[wiring[k]] = row[I_1 + k]
    for k in range(OUTPUTS):
        out = outputs[k]
        current_loop(out.phase != OFF and not safe, currents[k], out, config)


@njit(cache=True, nogil=True)
def advance(samples, first_sample, steps_per_sample, h, drive, wiring, settings, valves, cylinders, plant,
            held, v, twist, mode, el, shaft, e_in, events, count, work, q, cap, minv, w, sh, kc, motor, gearbox,
            oil, load, table, keys, hum, gauge_state, counts, valve_parameters, clutches, law_config, law_profiles,
            law_outputs, law_state, currents, log, effects, pieces, curves):
    """Move everything by whole controller samples; row j of the ring ``log`` is the time j * h after 0.

    Order at each controller sample: the duty answered to the last sample is applied, then (drive BY_LAW) the law
    answers this one. So the controller acts with one sample of delay, in the kernel and outside it alike. BY_SETPOINT
    the duty is that of the power stage for the newest setpoints and the currents of the last sample, which the
    controller saw too: the same delay, wherever the current loop is closed.
    """
    rows = log.shape[0]
    for s in range(first_sample, first_sample + samples):
        row = log[(s * steps_per_sample) % rows]
        if drive == BY_SETPOINT and s > 0:
            power_stage(log[((s - 1) * steps_per_sample) % rows], settings[0].safe > 0.0, wiring, currents, law_outputs,
                        law_config[0])
        if drive != BY_DUTY:
            for k in range(VALVES):
                valves[k].pending = law_outputs[wiring[k]].duty
        if drive == BY_LAW:
            for k in range(VALVES):
                currents[wiring[k]] = row[I_1 + k]
            law_step(s, currents, law_config[0], law_profiles, law_outputs, law_state[0])
        for k in range(VALVES):
            valves[k].duty = 0.0 if settings[0].safe > 0.0 else valves[k].pending
        if effects[0].current_loop == 0.0:
            for k in range(VALVES):
                on = settings[0].safe == 0.0
                valves[k].current = law_outputs[wiring[k]].setpoint if on else 0.0
        for i in range(steps_per_sample):
            index = s * steps_per_sample + i
            if effects[0].prescribed > 0.0:
                for k in range(VALVES):
                    out = law_outputs[wiring[k]]
                    since = (index + 1 - out.start * steps_per_sample) * h
                    curves[k] = prescribed_pressure(since, out.phase, pieces[k])
            plant_step(h, index * h, settings[0], valves, cylinders, plant[0], held[0], v, twist, mode, el,
                       shaft, e_in, events, count, work, q, cap, minv, w, sh, kc, motor[0], gearbox[0], oil[0],
                       load[0], valve_parameters, clutches, effects[0], curves)
            measure(log[(index + 1) % rows], index + 1, h, v, valves, cylinders, plant[0], oil[0], effects[0], table, keys,
                    hum, gauge_state, counts)
