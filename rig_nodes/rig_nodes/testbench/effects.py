# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the thesis names as the sources of its own errors, each to be switched off, so that its effect can be shown.

Used by testbench.configuration and testbench.rig: a switched-off effect is a rig whose parameters leave it out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..config.schema import param, switch


@dataclass(frozen=True)
class EffectsConfig:
    """On: as in the laboratory. Off: as in a simulation that leaves it out (thesis chapters 9.2 and 10).

    current_loop: coil and controller form the current, with the overshoot of the PID; off: it is the setpoint.
    motor_speed: n_wej gives way under load; off: it is the setpoint. torque_losses: losses by torque; off: by speed
    alone. valve_hysteresis: iron and friction of the magnet. seal_friction: rise and release of a piston differ.
    spline_hysteresis: capacity outlasts the clamp force on release. oil_temperature: viscosity by temperature.
    plate_heat: friction by the plates' temperature. wear: clearance grows with slip. transducers: errors, disturbances,
    range and resolution of what is measured; off: the true values. pwm_frequency: of the resolved PWM, 0 Hz for its
    average.
    """

    current_loop: bool = switch()
    motor_speed: bool = switch()
    torque_losses: bool = switch()
    valve_hysteresis: bool = switch()
    seal_friction: bool = switch()
    spline_hysteresis: bool = switch()
    oil_temperature: bool = switch()
    plate_heat: bool = switch()
    wear: bool = switch()
    transducers: bool = switch()
    pwm_frequency: float = param("frequency", 0.0, 1e5)


def leave_out(parts: dict, effects: EffectsConfig) -> dict:
    """The parts (name -> dataclass) of a rig without what is switched off; what the kernel switches stays."""
    out = dict(parts)

    def change(*names: str, **values) -> None:
        for name in names:
            out[name] = replace(out[name], **values)

    valves, clutches = ("valve_zr_p1", "valve_zr_p2"), ("clutch_s1", "clutch_s2")
    if not effects.torque_losses:
        change("gearbox", loss_in_constant=0.0, loss_in_share=0.0, loss_in_square=0.0, loss_out_share=0.0,
               loss_out_square=0.0)
    if not effects.valve_hysteresis:
        change(*valves, hysteresis=0.0, friction_pressure=0.0)
    if not effects.seal_friction:
        change(*clutches, seal_friction=0.0, seal_friction_share=0.0)
    if not effects.oil_temperature:
        change("oil_supply", viscosity_per_kelvin=0.0)
    if not effects.plate_heat:
        change("plate_pack", friction_per_kelvin=0.0)
    if not effects.wear:
        change("plate_pack", wear_rate=0.0)
    return out
