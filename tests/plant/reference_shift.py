# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One shift by scipy's adaptive integrator: the plant's equations written down again, independently of its kernel.

Used by test_reference_shift.py. Nothing here depends on the kernel's step or its order of computation: every device is a
differential equation in continuous time, solved to a relative tolerance between events.

Functions that are not smooth are treated as follows:

* duty: constant over a controller sample, so each millisecond is integrated separately; in it the coil's current is an
  exponential, and the magnet's hysteresis (a play operator) has its exact value, because the current does not reverse.
* clutches that slip, stick, break away: events; the speeds are projected on the locked state, and torques jump there.
* hysteresis of splines and contact (play operators on clamp force and piston): pulled into their band within PULL.
* empty part of a line: it takes all of the valve's flow until only FILLED is left.
* friction of spool and seals, stops, limits: continuous functions with corners, left to the tolerance control.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, exp, log10, pi, sqrt
from types import SimpleNamespace

import numpy as np
from scipy.integrate import solve_ivp

from rig_nodes.plant.friction import closed, drag

SAMPLE = 1e-3  # s between two duties
ROW = 1e-4  # s between two logger rows
PULL = 1e-6  # s
FILLED = 1e-10  # m3: below this volume the empty part of a line takes a decreasing share of the flow
LAMINAR = 2e3  # Pa, below which the valve's orifice is linear in any case (docstring of its flow)
RPM = pi / 30.0
# slips from the speeds (w_wej, w_wyj), by the teeth of tab. 3.2: wheel z3 less w_pos, w0 less wheel z5
SLIPS = ((34 / 47, -41 / 41), (1.0, -41 / 40))
STUCK = 0
W_IN, W_OUT, W_ROTOR, TWIST, TORQUE, INTEGRAL, LOAD, SUPPLY, FIRST = range(9)
SPOOL, LINE, CHAMBER, PISTON, EMPTY, HELD, REST, BOUNDARY, HEAT, WEAR, PER_CLUTCH = range(11)
# absolute tolerances, each far below the compared differences: rad/s, rad, Nm, Pa; m, Pa, m3, N, shares, K, m
PER_PACK = (1e-13, 1e-2, 1e-2, 1e-13, 1e-13, 1e-6, 1e-9, 1e-9, 1e-9, 1e-20)
ATOL = (1e-9, 1e-9, 1e-9, 1e-11, 1e-7, 1e-7, 1e-1, 1e-1, *2 * PER_PACK)
CHANNELS = ("M_wej", "n_wej", "M_wyj", "n_wyj", "p1", "p2", "p_p")


def clamp(value, low, high):
    return min(max(value, low), high)


@dataclass
class Start:
    """State of the plant at the order: ``y`` as the integrator has it, currents [A] and magnets [Pa] of both valves,
    modes of both clutches (1 slipping forward, -1 backward, STUCK); setpoints of motor [rad/s], load and oil [Pa].
    """

    y: np.ndarray
    current: list[float]
    magnet: list[float]
    modes: list[int]
    motor: float
    load: float
    oil: float


class Equations:
    """The right-hand side for one millisecond; ``config`` is a RigConfig, all values of one rig with every effect on."""

    def __init__(self, config, start: Start):
        self.start = start
        names = ("motor", "load_pump", "oil_supply", "loss_in", "loss_out", "rotor", "input_shaft", "M_wyj", "alfa46")
        self.c = SimpleNamespace(**{name: getattr(config, name) for name in names})  # found faster than in a RigConfig
        self.valves = (config.valve_zr_p1, config.valve_zr_p2)
        self.cylinders = (config.clutch_s1, config.clutch_s2)
        pack = self.pack = config.plate_pack
        self.slow, self.fast = (
            [closed.thesis(pack, pack.friction_correction, mu, pack.friction_spline, releasing=way) for way in (False, True)]
            for mu in (pack.friction_static, pack.friction_kinetic)
        )  # torque per force at rest and in fast slip, as the pack is pressed and as it is let go
        self.waves = pack.rest_torque / self.slow[0]
        self.film = drag.kitabayashi(pack, 1.0, 1.0, 1.0)
        self.j_in, self.j_out = config.w0.inertia, config.z5.inertia * (41 / 40) ** 2
        self.stiff = [a * a / self.j_in + b * b / self.j_out for a, b in SLIPS]
        self.modes = list(start.modes)
        self.current, self.magnet = list(start.current), list(start.magnet)
        self.duty, self.t0 = (0.0, 0.0), 0.0
        oil = config.oil_supply
        points = ((oil.viscosity_temperature, oil.viscosity), (oil.second_temperature, oil.second_viscosity))
        (t1, w1), (t2, w2) = ((log10(t + 273.15), log10(log10(1e6 * mu / oil.density + 0.7))) for t, mu in points)
        self.astm = (t1, w1, (w2 - w1) / (t2 - t1))
        self.thick = self.viscosity(oil.temperature)
        self.drops = {}
        self.settled = 0.0, 0.0  # torques that the clutches carry and at the output's meter, where the next search begins

    # ---- coil and magnet, in closed form over the millisecond that began at t0

    def current_at(self, k, t):
        v = self.valves[k]
        steady = self.duty[k] * v.coil_voltage / v.coil_resistance
        decay = exp(-(t - self.t0) * v.coil_resistance / v.coil_inductance)
        return max(0.0, steady + (self.current[k] - steady) * decay)

    def magnet_at(self, k, t):
        v = self.valves[k]
        force = v.pressure_gain * self.current_at(k, t)
        return clamp(self.magnet[k], (1.0 - v.hysteresis) * force, (1.0 + v.hysteresis) * force)

    def next_sample(self, t, duty):
        """Continues from t with other duties."""
        for k in range(2):
            self.magnet[k], self.current[k] = self.magnet_at(k, t), self.current_at(k, t)
        self.duty, self.t0 = duty, t

    # ---- hydraulics of one clutch

    def clamp_force(self, k, piston, wear):
        x = self.cylinders[k]
        squeeze = piston - x.clearance - wear
        return x.pack_rate * squeeze / max(1e-4, 1.0 - squeeze / x.pack_travel) if squeeze > 0.0 else 0.0

    def viscosity(self, temperature):
        """Returns the viscosity [Pa s] at a temperature [degC] by ASTM D341."""
        t1, w1, rise = self.astm
        return 1e-6 * self.c.oil_supply.density * (10.0 ** (10.0 ** (w1 + rise * (log10(temperature + 273.15) - t1))) - 0.7)

    def laminar_drop(self, area):
        """Returns the pressure drop [Pa] below which the flow through a sharp-edged orifice of an effective area is laminar.

        Re = 9.3 with the diameter of the round hole; the discharge coefficient is 0.61.
        """
        if area not in self.drops:
            density, diameter = self.c.oil_supply.density, sqrt(4.0 * area / 0.61 / pi)
            self.drops[area] = density / 2.0 * (9.3 * self.thick / density / diameter / 0.61) ** 2
        return self.drops[area]

    def valve_flow(self, k, spool, port, supply):
        """Returns the flow into the line, from the supply or to the tank [m3/s]."""
        v = self.valves[k]
        if spool > 0.0:
            opened, edge, bore, drop, sign = spool, v.orifice_area, v.supply_bore_area, max(0.0, supply - port), 1.0
        elif spool < -v.spool_dead_band:
            opened, edge, bore, drop, sign = -spool - v.spool_dead_band, v.drain_area, v.drain_bore_area, port, -1.0
        else:
            return 0.0
        area, full = opened / v.spool_stroke * edge, edge
        if bore > 0.0:
            area, full = 1.0 / sqrt(1.0 / area**2 + 1.0 / bore**2), min(edge, bore)
        below = max(LAMINAR, self.laminar_drop(full))
        return sign * area * sqrt(2.0 / self.c.oil_supply.density) * drop / (drop * drop + below**2) ** 0.25

    def hydraulics(self, k, t, z, supply, speed):
        """Returns (rates of SPOOL to REST, flow through the valve, clamp force) for the clutch's part z of the state.

        ``speed`` is that of the chamber.
        """
        v, x, oil = self.valves[k], self.cylinders[k], self.c.oil_supply
        spool, line, chamber, piston = z[SPOOL], z[LINE], z[CHAMBER], z[PISTON]
        flow = self.valve_flow(k, spool, line, supply)
        middle = self.magnet_at(k, t) - v.pressure_gain * v.cracking_current
        swing = v.coil_voltage * self.duty[k] * (1.0 - self.duty[k]) / (v.coil_inductance * self.c.alfa46.values.pwm_frequency)
        friction = max(0.0, v.friction_pressure - 0.5 * v.pressure_gain * swing)
        lowest = min(middle - friction, v.pressure_limit)
        highest = min(middle + friction, v.pressure_limit)
        per_pascal = v.spool_stroke / v.full_opening_pressure
        target = clamp(spool, per_pascal * (lowest - line), per_pascal * (highest - line))
        moving = (target - spool) / (v.spool_time * self.thick / oil.viscosity)
        if (spool >= v.spool_stroke and moving > 0.0) or (spool <= -v.spool_dead_band - v.spool_stroke and moving < 0.0):
            moving = 0.0  # it is at a stop

        lost, emptying = 0.0, 0.0
        if spool > 0.0:
            lost = self.valve_flow(k, spool, 0.0, supply) * clamp(z[EMPTY] / FILLED, 0.0, 1.0)
        elif chamber <= 10e3:
            emptying = (x.drained_volume - z[EMPTY]) / x.drain_time
        turbulent = oil.density / (2.0 * x.feed_area**2)
        laminar = sqrt(0.5 * oil.density * self.laminar_drop(x.feed_area)) / x.feed_area
        drop = line - chamber
        feed = copysign(2.0 * abs(drop) / (laminar + sqrt(laminar**2 + 4.0 * turbulent * abs(drop))), drop)
        force = self.clamp_force(k, piston, z[WEAR])
        push = (x.piston_area + x.force_per_pressure_squared * max(0.0, chamber)) * chamber
        push += 0.5 * oil.density * (speed * x.centrifugal_radius) ** 2 * x.piston_area
        rest = push - x.spring_preload - x.spring_rate * piston - force
        seal = x.seal_friction + x.seal_friction_share * abs(push)
        moves = (rest - clamp(rest, -seal, seal)) / (x.piston_damping * self.thick / oil.viscosity)
        if piston <= 0.0:
            moves = max(0.0, moves)
        held = self.between(z[BOUNDARY], [a / b for b, a in (self.slow, self.fast)])
        open_gap = x.clearance + z[WEAR]
        apart = max(0.0, open_gap - piston) / min(self.pack.surfaces * self.pack.film_gap, open_gap)
        pulled = [
            (clamp(z[kind], low, high) - z[kind]) / PULL
            for kind, low, high in (
                (HELD, force, held * force),
                (REST, min(1.0, force / self.pack.film_force), max(0.0, 1.0 - apart)),
            )
        ]
        return (
            [
                moving,
                (flow - lost - feed) * oil.bulk_modulus / x.line_volume,
                (feed - x.piston_area * moves) * oil.bulk_modulus / x.chamber_volume,
                moves,
                emptying - lost,
                *pulled,
            ],
            flow,
            force,
        )

    # ---- clutches and shafts

    @staticmethod
    def between(boundary, ends):
        """Returns the value at a share of boundary friction, between those at rest and in fast slip."""
        return ends[1] + (ends[0] - ends[1]) * boundary

    def pressing(self, z):
        """Returns the force on the plates [N]: the clamp force with the additions by splines and waves."""
        return z[HELD] + self.waves * z[REST]

    def settling(self, z, slip):
        """Returns the rate of BOUNDARY: towards Stribeck's curve, as the oil is squeezed out or drawn in [1/s]."""
        pack, thicker = self.pack, self.viscosity(z[HEAT]) / self.c.oil_supply.viscosity
        area, force = pi * (pack.outer_radius**2 - pack.inner_radius**2), self.pressing(z)
        over = abs(slip) * pack.mean_radius / pack.friction_speed * thicker * pack.friction_pressure * area
        share = (exp(-over / force) if force > 1e-3 * over else 0.0) if over else 1.0
        return (share - z[BOUNDARY]) / (pack.film_time * thicker)

    def capacities(self, k, z, force):
        """Returns (largest friction torque of the clutch, slipping or stuck [Nm], drag [Nm s/rad])."""
        x, pack = self.cylinders[k], self.pack
        factor = max(0.2, 1.0 + pack.friction_per_kelvin * (z[HEAT] - pack.friction_temperature))
        torque = factor * self.pressing(z) * self.between(z[BOUNDARY], (self.slow[0], self.fast[0]))
        gap = max((x.clearance + z[WEAR] - z[PISTON]) / pack.surfaces, pack.film_gap)
        return torque, self.film * self.viscosity(z[HEAT]) / gap * max(0.0, 1.0 - force / pack.film_force)

    def twisted(self, y):
        """Returns the torque of the input shaft, which its meter shows."""
        shaft = self.c.input_shaft
        return shaft.stiffness * y[TWIST] + shaft.damping * (y[W_ROTOR] - y[W_IN])

    def shafts(self, y, capacities):
        """Returns the motion of the shafts in the present modes.

        These are accelerations, friction torques and drag torques of the clutches, their slips, and the torque at the output's
        meter; the first four are given for w_wej and w_wyj or for S1 and S2.
        """
        w = (y[W_IN], y[W_OUT])
        if min(w) <= 0.0:
            raise ValueError("this reference knows shafts that turn forwards only")
        load = self.c.load_pump.displacement * y[LOAD] + self.c.load_pump.mechanical_loss
        into, out, n = self.c.loss_in, self.c.loss_out, w[0] / RPM
        by_speed = into.by_speed * max(0.0, -1.76e-6 * n * n + 4.58e-3 * n + 2.56)
        rest, began = into.at_rest**2, into.at_470**2
        by_speed += sqrt(rest + (began - rest) * w[0] / 49.274)
        slips = [a * w[0] + b * w[1] for a, b in SLIPS]
        viscous = [capacity[1] * slip for capacity, slip in zip(capacities, slips)]
        stuck = [k for k in range(2) if self.modes[k] == STUCK]
        if len(stuck) > 1:
            raise ValueError("both clutches stick")
        carried, meter = self.settled
        for _ in range(60):
            # the losses depend on the torques that they change, so they are iterated: a contraction by a factor below 0.2
            u = abs(carried) if into.square >= 0.0 else min(abs(carried), -0.5 * into.share / into.square)
            loss_in = by_speed + max(0.0, into.constant + into.share * u + into.square * u * u)
            m = abs(meter)
            loss_out = 41 / 40 * max(0.0, out.drag)
            by_load = 41 / 40 * max(0.0, out.share * m + out.square * m * m)
            if out.torque_side == "driving":
                loss_in += by_load * min(1.0, w[1] / w[0])  # the loss takes the same power
            else:
                loss_out += by_load
            free = [self.twisted(y) - loss_in, -load - loss_out]
            torques = [mode * capacity[0] for mode, capacity in zip(self.modes, capacities)]
            for k, (a, b) in enumerate(SLIPS):
                free[0] -= a * (viscous[k] + torques[k])
                free[1] -= b * (viscous[k] + torques[k])
            for k in stuck:
                a, b = SLIPS[k]
                torques[k] = (a * free[0] / self.j_in + b * free[1] / self.j_out) / self.stiff[k]
                free[0] -= a * torques[k]
                free[1] -= b * torques[k]
            rates = (free[0] / self.j_in, free[1] / self.j_out)
            before = carried, meter
            carried = sum(a * torque for (a, _), torque in zip(SLIPS, torques))
            meter = load + self.c.M_wyj.inertia * rates[1]
            if abs(carried - before[0]) + abs(meter - before[1]) < 1e-12 * (1.0 + abs(meter)):
                self.settled = carried, meter
                return rates, torques, viscous, slips, meter
        raise ValueError("the losses by torque do not settle")

    def whole(self, t, y):
        """Returns everything at once: (hydraulics of both, capacities of both, shafts)."""
        parts = [y[FIRST + k * PER_CLUTCH : FIRST + (k + 1) * PER_CLUTCH] for k in range(2)]
        speeds = (y[W_IN] * 34 / 47, y[W_OUT] * 41 / 40)  # of z3 and z5, which carry the cylinders
        oil = [self.hydraulics(k, t, parts[k], y[SUPPLY], speeds[k]) for k in range(2)]
        capacities = [self.capacities(k, parts[k], oil[k][2]) for k in range(2)]
        return parts, oil, capacities, self.shafts(y, capacities)

    def rates(self, t, y):
        """Returns dy/dt."""
        y = y.tolist()
        parts, oil, _, (accelerations, torques, viscous, slips, _) = self.whole(t, y)
        c, m = self.c, self.c.motor
        upper = min(m.torque_limit, m.power_limit / max(y[W_ROTOR], 1.0))
        lower = -min(m.braking_limit, upper)
        error = self.start.motor - y[W_ROTOR]
        integral = m.speed_gain_integral * error
        if (y[INTEGRAL] >= upper and integral > 0.0) or (y[INTEGRAL] <= lower and integral < 0.0):
            integral = 0.0
        asked = clamp(m.speed_gain * error + y[INTEGRAL], lower, upper)
        n = y[W_OUT] / RPM
        relief = min(self.start.load * (3.84e-7 * n * n - 6.36e-4 * n + 1.32), c.load_pump.pressure_limit)
        drawn = sum(max(0.0, flow) for _, flow, _ in oil)
        supply = max(0.0, self.start.oil - c.oil_supply.relief_droop * drawn)
        out = [
            *accelerations,
            (y[TORQUE] - self.twisted(y)) / c.rotor.inertia,
            y[W_ROTOR] - y[W_IN],
            (asked - y[TORQUE]) / m.torque_time,
            integral,
            (relief - y[LOAD]) / c.load_pump.pressure_time,
            (supply - y[SUPPLY]) / c.oil_supply.pressure_time,
        ]
        for k in range(2):
            power = (torques[k] + viscous[k]) * slips[k]
            warmer = (power - self.pack.cooling * (parts[k][HEAT] - c.oil_supply.temperature)) / self.pack.heat_capacity
            wear = (
                self.pack.wear_rate
                * max(0.0, 1.0 + self.pack.wear_per_kelvin * (parts[k][HEAT] - self.pack.friction_temperature))
                * power
            )
            out += [*oil[k][0], self.settling(parts[k], slips[k] if self.modes[k] != STUCK else 0.0), warmer, wear]
        return out

    def meters(self, t, y):
        """Returns the logger's readings in the order of CHANNELS; the output's meter is outside the gearbox's own inertia."""
        *_, meter = self.whole(t, y.tolist())[-1]
        return self.twisted(y), y[W_IN], meter, y[W_OUT], y[FIRST + CHAMBER], y[FIRST + PER_CLUTCH + CHAMBER], y[SUPPLY]

    # ---- stick and slip

    def margin(self, k, t, y):
        """Returns the value whose zero is the next event of clutch k: its slip, or, while it sticks, its torque margin."""
        y = y.tolist()
        if self.modes[k] != STUCK:
            a, b = SLIPS[k]
            return self.modes[k] * (a * y[W_IN] + b * y[W_OUT])
        _, _, capacities, (_, torques, *_) = self.whole(t, y)
        return capacities[k][0] - abs(torques[k])

    def after_event(self, k, t, y):
        """Returns the new mode of clutch k after its event, and the speeds with a slip that is exactly zero."""
        a, b = SLIPS[k]
        before = self.modes[k]
        self.modes[k] = STUCK
        _, _, capacities, (_, torques, *_) = self.whole(t, y.tolist())
        spare = capacities[k][0] - abs(torques[k])
        if before == STUCK or spare < 0.0:
            self.modes[k] = int(copysign(1, torques[k])) if before == STUCK else -before
        slip = a * y[W_IN] + b * y[W_OUT]
        y[W_IN] -= a / self.j_in * slip / self.stiff[k]
        y[W_OUT] -= b / self.j_out * slip / self.stiff[k]


def solve(config, start: Start, duty: np.ndarray, rtol: float = 1e-8, method: str = "LSODA", pieces: int = 1):
    """Returns (channels, events): logger rows of CHANNELS (1 + 10 n, 7) from the order on, and (time, clutch, new mode).

    ``duty`` (n, 2) is that of both coils in each millisecond after the order. A method begins anew ``pieces`` times in each of
    them: scipy's Radau and BDF keep the slopes from before a piston breaks away, and with one piece it stands up to 1 ms longer.
    """
    eq = Equations(config, start)
    eq.duty = tuple(duty[0])
    y, events = np.array(start.y, float), []
    rows = [eq.meters(0.0, y)]
    watch = [lambda t, y, k=k: eq.margin(k, t, y) for k in range(2)]
    for event in watch:
        event.terminal, event.direction = True, -1.0
    for sample in range(len(duty)):
        t, end = sample * SAMPLE, (sample + 1) * SAMPLE
        eq.next_sample(t, tuple(duty[sample]))
        due = t + ROW * np.arange(1, 11)
        due[-1] = end
        ends = due[10 // pieces - 1 :: 10 // pieces]
        while t < end:
            until = ends[ends > t][0]
            inside = due[(due > t) & (due <= until)]
            done = solve_ivp(eq.rates, (t, until), y, method, t_eval=inside, events=watch, rtol=rtol, atol=ATOL)
            if done.status < 0:
                raise ValueError(f"at {t:.4f} s: {done.message}")
            rows.extend(eq.meters(when, state) for when, state in zip(done.t, np.transpose(done.y)))
            if done.status == 0:
                t, y = until, done.y[:, -1].copy()
                continue
            k = next(k for k in range(2) if len(done.t_events[k]))
            t, y = done.t_events[k][-1], done.y_events[k][-1].copy()
            eq.after_event(k, t, y)
            events.append((t, k, eq.modes[k]))
    return np.array(rows), events
