# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ratios of the whole HydmAG, and steady states of its hydrostatic drive by separate formulas."""

from __future__ import annotations

from math import floor, pi
from typing import TYPE_CHECKING, NamedTuple

from rig_nodes.runs import Table

if TYPE_CHECKING:
    from rig_nodes.rig import RigConfig

RPM = pi / 30.0
STATES = ("hydrostatic", "I", "II")  # of tab. 3.1


class Steady(NamedTuple):
    """A steady state: swivel of the motor, pressures [Pa], speeds [rad/s] and torques [Nm] of both machines."""

    swivel: float
    high: float
    low: float
    pump_speed: float
    pump_torque: float
    motor_speed: float
    motor_torque: float

    @property
    def efficiency(self) -> float:
        """Power of the motor over that of the pump, which includes the boost pump."""
        return self.motor_torque * self.motor_speed / (self.pump_torque * self.pump_speed)


def mesh_ratio(config: RigConfig, a: str, b: str) -> float:
    """Return the teeth of the wheel on a over those on b, which is the speed of b over that of a."""
    return next(one.teeth[0] / one.teeth[1] for one in config.structure.meshes if one.bodies == (a, b))


def steady_state(config: RigConfig, speed_in: float, speed_out: float, torque_out: float) -> Steady:
    """Return the steady state at the pump's full swivel, both clutches open.

    Flow balance of the lines with linear leaks, torque balance of the machines with their friction; the swivel of the motor
    that holds the speed of the output is found by repeated substitution.

    Parameters
    ----------
    config : RigConfig
        The rig.
    speed_in, speed_out : float
        Speeds of w0 and wk [rad/s].
    torque_out : float
        Torque that wk takes from z6, including losses of the gears [Nm].

    Returns
    -------
    Steady
        The steady state.
    """
    it = config.hydrostatic
    pump, up = speed_in * mesh_ratio(config, "w0", "z2"), mesh_ratio(config, "wk", "z6")
    motor, torque = speed_out * up, torque_out / up
    swivel, high, low = 0.5, 0.0, 0.0
    for _ in range(100):
        volume = swivel * it.motor_displacement
        between = (torque + it.friction + it.friction_speed * motor) / (volume * (1.0 - it.friction_share))
        # the flow of the check valve less that of the flushing valve replaces the leakage of both lines into the housings
        check, flush, out = 1.0 / it.boost_resistance, 1.0 / it.flushing_resistance, 1.0 / it.leak_out
        low = (check * it.boost_pressure + flush * it.flushing_pressure - out * between) / (check + flush + 2.0 * out)
        high = low + between
        flow = it.pump_displacement * pump - between / it.leak_across - high * out
        swivel = flow / (it.motor_displacement * motor)
    rubs = it.friction + it.friction_speed * pump + it.friction_share * between * it.pump_displacement
    taken = it.pump_displacement * between + rubs + it.boost_displacement * it.boost_pressure
    return Steady(swivel, high, low, pump, taken, motor, torque)


def losses_out(config: RigConfig) -> float:
    """Return the loss on wk that does not depend on torque, stated on the z5 axis; the clutches' drag is left out [Nm]."""
    return config.loss_out.drag * mesh_ratio(config, "wk", "z5")


def ratios(config: RigConfig) -> Table:
    """Return the ratios of tab. 3.1 from the teeth of tab. 3.2, exact and cut or rounded to the printed digits."""
    of = {gear.name: config.transmission.ratios[number] for number, gear in enumerate(config.structure.gears, 1)}
    of["hydrostatic"] = mesh_ratio(config, "wk", "z6")
    rows = [(name, of[name], floor(of[name] * 1e3) * 1e-3, round(of[name], 3)) for name in STATES]
    return Table(
        "Ratios of thesis tab. 3.1 from the teeth of tab. 3.2: that of the hydrostatic state, from S_h to the output, is z8 / z6.",
        {"state": "", "ratio": "-", "cut": "-", "rounded": "-"},
        rows,
    )


def clutches(config: RigConfig) -> Table:
    """Return the clutches that are closed in each state of tab. 3.1: 1 closed, 0 open."""
    held = {gear.name: gear.clutches for gear in config.structure.gears}
    names = [one.name for one in config.structure.clutches]
    rows = [(state, *(float(name in held.get(state, ())) for name in names)) for state in STATES]
    return Table("States of the clutches in thesis tab. 3.1: 1 closed, 0 open.", {"state": "", "s1": "-", "s2": "-"}, rows)


def branch(config: RigConfig) -> Table:
    """Return steady states of the hydrostatic drive at the speed of gear I, over speed and torque at the output."""
    ratio, rows = config.transmission.ratios[1], []
    for rpm in (1000.0, 1500.0, 2000.0):
        for torque in (40.0, 80.0, 120.0, 240.0):
            speed = rpm * RPM
            one = steady_state(config, speed, speed / ratio, torque + losses_out(config))
            rows.append((speed, torque, one.swivel, one.high, one.low, one.pump_torque, one.motor_torque, one.efficiency))
    return Table(
        "Hydrostatic drive at the speed of gear I, pump at its full swivel: swivel of S_h without slip at S1, and efficiency.",
        {
            "n_wej": "rpm",
            "M_wyj": "Nm",
            "swivel": "%",
            "p_A": "MPa",
            "p_B": "MPa",
            "pump_torque": "Nm",
            "motor_torque": "Nm",
            "efficiency": "%",
        },
        rows,
    )


def limits(config: RigConfig) -> Table:
    """Return the largest torque at the output by the relief valve and the lowest pressure that a line may have."""
    it, up = config.hydrostatic, mesh_ratio(config, "wk", "z6")
    most = it.relief_pressure * it.motor_displacement
    rows = [
        ("relief", most, most * up, it.relief_pressure),
        ("gear I at 271 Nm", 271.0, 271.0 * config.transmission.ratios[1], None),
    ]
    return Table(
        "Torque of S_h and at the output at the pressure of the relief valve, without losses, and of gear I for comparison.",
        {"what": "", "torque": "Nm", "M_wyj": "Nm", "pressure": "MPa"},
        rows,
    )


CALCULATIONS = {"ratios": ratios, "clutches": clutches, "branch": branch, "limits": limits}
