# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Values of a rig that belong to no device: of its bodies, shafts, instruments and of the effects that can be left out.

Read by testbench.configuration; every field has its dimension and range, as a part's have.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, make_dataclass
from functools import lru_cache

from ..config.schema import param, switch
from .structure import Structure


@dataclass(frozen=True)
class BodyConfig:
    """A body that turns: its inertia about its own axis."""

    inertia: float = param("inertia", 1e-6, 1e4)


@dataclass(frozen=True)
class ShaftConfig:
    """A compliant shaft; damping acts on the difference of its ends' speeds."""

    stiffness: float = param("torque per angle", 1e2, 1e8)
    damping: float = param("torque per speed", 0.0, 1e5)


@dataclass(frozen=True)
class EffectsConfig:
    """On: as in the laboratory. Off: as in a simulation that leaves it out (thesis chapters 9.2 and 10).

    current_loop: coil and controller form the current, with the overshoot of the PID; off: it is the setpoint.
    motor_speed: the input gives way under load; off: it is the setpoint. torque_losses: losses by torque; off: by speed
    alone. valve_hysteresis: iron and friction of the magnet. seal_friction: rise and release of a piston differ.
    spline_hysteresis: capacity outlasts the clamp force on release. oil_temperature: viscosity by temperature.
    plate_heat: friction by the plates' temperature. wear: clearance grows with slip. transducers: errors, disturbances,
    range and resolution of what is measured; off: the true values. pwm_frequency: of the resolved PWM, 0 Hz for its
    average. What a rig does not name is on, with averaged PWM.
    """

    current_loop: bool = switch(True)
    motor_speed: bool = switch(True)
    torque_losses: bool = switch(True)
    valve_hysteresis: bool = switch(True)
    seal_friction: bool = switch(True)
    spline_hysteresis: bool = switch(True)
    oil_temperature: bool = switch(True)
    plate_heat: bool = switch(True)
    wear: bool = switch(True)
    transducers: bool = switch(True)
    pwm_frequency: float = param("frequency", 0.0, 1e5, 0.0)


def _pressure_fields() -> dict:
    return {"noise": param("pressure", 0.0, 1e7, 0.0), "range": param("pressure", 1e5, 1e9),
            "class": param("ratio", 0.0, 0.1, 0.0), "hum": param("pressure", 0.0, 1e6, 0.0),
            "pickup": param("pressure", 0.0, 1e6, 0.0)}


# type of transducer -> what its values are: noise (standard deviation), range, class (largest error as a share of the range,
# (7.1)), amplitude of the hum, height of the coil pulses that it picks up; of an encoder what it resolves and the time in which
# its pulses are counted; of a thermometer offset and gain of (7.2)
TYPES = {
    "torque": lambda: {"noise": param("torque", 0.0, 100.0, 0.0), "range": param("torque", 1.0, 1e5),
                       "class": param("ratio", 0.0, 0.1, 0.0), "hum": param("torque", 0.0, 100.0, 0.0)},
    "speed": lambda: {"noise": param("angular velocity", 0.0, 100.0, 0.0), "range": param("angular velocity", 0.1, 1e5),
                      "step": param("angular velocity", 0.0, 10.0, 0.0), "gate": param("time", 1e-6, 0.1)},
    "pressure": _pressure_fields,
    "current": lambda: {"noise": param("current", 0.0, 0.1, 0.0), "range": param("current", 0.1, 100.0)},
    "temperature": lambda: {"range": param("temperature", 1.0, 1e3), "offset": param("temperature", 0.0, 10.0, 0.0),
                            "gain": param("ratio", 0.0, 0.1, 0.0)},
    "travel": lambda: {"noise": param("length", 0.0, 1e-3, 0.0), "range": param("length", 1e-4, 1.0),
                       "class": param("ratio", 0.0, 0.1, 0.0)},
    "force": lambda: {"noise": param("force", 0.0, 1e4, 0.0), "range": param("force", 1.0, 1e6),
                      "class": param("ratio", 0.0, 0.1, 0.0), "fitted": switch(True)},
}


@lru_cache(maxsize=32)
def instruments_class(kinds: tuple[tuple[str, str], ...]) -> type:
    """The dataclass of a rig's instruments: fields ``<like>_<what>`` of each pair (like, type) of its transducers.

    Beside them hum_frequency, anti_alias: corner frequency of the low pass, and resolution_bits: of the range, of analog
    channels; both 0 where there is none.
    """
    out = [(f"{like}_{what}", float, one) for like, kind in kinds for what, one in TYPES[kind]().items()]
    out += [("hum_frequency", float, param("frequency", 1.0, 1e3)), ("anti_alias", float, param("frequency", 0.0, 1e5, 0.0)),
            ("resolution_bits", float, param("ratio", 0.0, 32.0, 0.0))]

    def reduce(self):  # so that a process can send one to another
        return _instruments, (kinds, tuple(getattr(self, one.name) for one in fields(self)))

    return make_dataclass("InstrumentsConfig", out, frozen=True, kw_only=True, namespace={
        "__doc__": "Of each transducer: noise, range, class, disturbances.", "__reduce__": reduce})


def _instruments(kinds, values):
    cls = instruments_class(kinds)
    return cls(**dict(zip((one.name for one in fields(cls)), values, strict=True)))


def instruments_of(structure: Structure) -> type:
    """The dataclass of the instruments of a rig."""
    return instruments_class(tuple(dict.fromkeys((one.like, one.type) for one in structure.transducers)))
