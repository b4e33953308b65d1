# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Values of a rig that belong to no device: of bodies, shafts, instruments, the step, and the effects that can be left out.

rig.configuration reads them; every field has its dimension and range, like the fields of a part.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, make_dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from ..base import SAMPLE, param, switch
from .structure import Structure
from .transducer_types import TRANSDUCER_TYPES

if TYPE_CHECKING:
    from collections.abc import Iterable

    from _typeshed import DataclassInstance


@dataclass(frozen=True)
class KernelConfig:
    """The step of the plant."""

    step: float = param("time", 1e-6, 1e-4, "Time by which the plant moves at once")


@dataclass(frozen=True)
class CutConfig:
    """How devices outside the plant are reached."""

    tick: float = param("time", SAMPLE, 1e-2, "Time for which both sides of a cut hold what the other one gave")


@dataclass(frozen=True)
class BodyConfig:
    """A body that turns."""

    inertia: float = param("inertia", 1e-6, 1e4, "Inertia of the body about its own axis, with all that is fixed to it")
    speed: float = param("angular velocity", -1e4, 1e4, "Speed of the body at time 0; left out, what others give it, or none", None)


def _coefficient(of: str) -> Any:
    return param("ratio", -1e4, 1e4, f"What the speed of the {of} body counts; left out, 1", None)


def _stick(way: str) -> Any:
    return param("ratio", 1.0, 10.0, f"Torque of break-away over the kinetic one{way}", None)


@dataclass(frozen=True, kw_only=True)
class ShaftConfig:
    """A compliant shaft."""

    stiffness: float = param(
        "torque per angle", 0.1, 1e8, "Torque of the shaft per angle of twist; one with a table has none", None
    )
    damping: float = param("torque per speed", 0.0, 1e5, "Torque of the shaft per difference of its ends' speeds")
    ca: float = _coefficient("first")
    cb: float = _coefficient("second")
    twist: float = param("angle", -1e3, 1e3, "Twist of the shaft at time 0; left out, none", None)
    backlash: float = param("angle", 0.0, 10.0, "Play from contact to contact, in the middle at twist 0; left out, none", None)
    friction: float = param("ratio", 0.0, 10.0, "Friction in it as a share of the torque of its spring; left out, none", None)


@dataclass(frozen=True)
class MeshConfig:
    """Toothed wheels that lose by the torque that they pass on; of a planetary set, those of sun and ring against its carrier."""

    efficiency: float = param(
        "ratio", 1e-3, 1.0, "Share of the power of the first body, or of the sun, that the second one gets, or the ring"
    )
    back: float = param(
        "ratio", -20.0, 1.0, "Share of the power back to the first body, or to the sun; left out, as efficiency", None
    )


@dataclass(frozen=True)
class ClutchConfig:
    """A clutch that is not a device: what presses it is not simulated."""

    ca: float = _coefficient("first")
    cb: float = _coefficient("second")
    stick: float = _stick("; left out, 1")
    stick_back: float = _stick(" with the second body ahead; left out, as stick")
    drag: float = param("torque per speed", 0.0, 1e5, "Torque per slip that acts at all times; left out, none", None)


@dataclass(frozen=True)
class BrakeConfig:
    """A clutch to the ground that is not a device."""

    stick: float = _stick("; left out, 1")
    stick_back: float = _stick(" as it turns backwards; left out, as stick")
    drag: float = param("torque per speed", 0.0, 1e5, "Torque per speed that acts at all times; left out, none", None)


@dataclass(frozen=True)
class SliderCrankConfig:
    """A slider that a body moves by a crank and a rod without mass."""

    mass: float = param("mass", 1e-6, 1e5, "Mass of the slider")
    radius: float = param("length", 1e-6, 100.0, "Radius of the crank")
    rod: float = param("length", 1e-6, 1e3, "Length of the rod, more than the radius")
    angle: float = param("angle", -1e3, 1e3, "Of the crank at time 0, 0 where the slider is farthest; left out, 0", None)


@dataclass(frozen=True)
class VariatorConfig:
    """A gear whose ratio is an input, follows a table over an angle, or both."""

    ratio: float = param(
        "ratio", -1e3, 1e3, "Speed of the first body over that of the second, where no input gives it; left out, 1", None
    )


@dataclass(frozen=True)
class StateConfig:
    """A temperature that rises by what elements lose."""

    capacity: float = param("heat capacity", 1e-3, 1e9, "Heat that warms it by 1 K")
    start: float = param("temperature", -273.0, 3e3, "Temperature at time 0")
    conductance: float = param("thermal conductance", 0.0, 1e6, "Heat flow to the surroundings per kelvin; left out, none", None)
    surroundings: float = param("temperature", -273.0, 3e3, "Temperature of the surroundings; left out, 0 degC", None)


# kind of an element of the driveline -> its values
ELEMENTS = {
    "clutch": ClutchConfig,
    "brake": BrakeConfig,
    "slider_crank": SliderCrankConfig,
    "variator": VariatorConfig,
    "state": StateConfig,
}


@lru_cache(maxsize=256)
def with_written(cls: type, names: tuple[str, ...]) -> type:
    """Return a dataclass of the fields that a rig has written: a value that is left out is not a setting.

    Parameters
    ----------
    cls : type
        The dataclass of a section.
    names : tuple of str
        Names of the written fields.

    Returns
    -------
    type
        The dataclass with these fields.
    """
    own = [one for one in fields(cls) if one.name in names]

    def reduce(self: DataclassInstance) -> tuple:  # so that a process can send one to another
        return _written, (cls, names, tuple(getattr(self, one.name) for one in own))

    return make_dataclass(
        cls.__name__,
        [(one.name, float, param(**one.metadata)) for one in own],
        frozen=True,
        kw_only=True,
        namespace={"__doc__": cls.__doc__, "__reduce__": reduce},
    )


def _written(cls: type, names: tuple[str, ...], values: Iterable[float]) -> object:
    made = with_written(cls, names)
    return made(**dict(zip((one.name for one in fields(made)), values, strict=True)))


def written(section: DataclassInstance) -> object:
    """Return the values of a section without those that are left out."""
    names = tuple(one.name for one in fields(section) if getattr(section, one.name) is not None)
    return _written(type(section), names, tuple(getattr(section, name) for name in names))


def section_classes(structure: Structure) -> dict[str, type]:
    """Return the dataclass of each body, shaft, mesh, planetary set and element that has values, by its name."""
    out = {name: BodyConfig for name in structure.bodies if name not in structure.massless}
    out |= dict.fromkeys((one.name for one in structure.shafts), ShaftConfig)
    out |= dict.fromkeys((one.name for one in (*structure.meshes, *structure.planetary_sets) if one.lossy), MeshConfig)
    return out | {one.name: ELEMENTS[one.kind] for one in structure.elements if one.kind in ELEMENTS}


@dataclass(frozen=True)
class EffectsConfig:
    """On: as in the laboratory. Off: as in a simulation that leaves it out (thesis chapters 9.2 and 10).

    What a rig does not name is on, with averaged PWM.
    """

    current_loop: bool = switch(
        "Coil and controller form the current, with the overshoot of the loop; off: the current is its setpoint", True
    )
    motor_speed: bool = switch("The input gives way under load; off: its speed is the setpoint", True)
    torque_losses: bool = switch("Gears lose by torque too; off: by speed alone", True)
    valve_hysteresis: bool = switch("Iron and friction of the valves' magnets; off: none", True)
    seal_friction: bool = switch(
        "Pistons rise and release at different pressures, by the friction of their seals; off: at the same", True
    )
    spline_hysteresis: bool = switch(
        "Plates stick on their splines, so that capacity outlasts the clamp force; off: it follows the force", True
    )
    oil_temperature: bool = switch(
        "The oil's viscosity follows its temperature; off: it is that of the reference temperature", True
    )
    plate_heat: bool = switch("Friction follows the plates' temperature; off: it is that of the reference temperature", True)
    wear: bool = switch("Clearances grow with slip; off: they stay", True)
    transducers: bool = switch("Errors, disturbances, range and resolution of what is measured; off: true values are shown", True)
    pwm_frequency: float = param("frequency", 0.0, 1e5, "Frequency of the resolved PWM of the coils; at 0 its average acts", 0.0)


LOGGER_RATE = 1e4  # Hz: of the laboratory's logger, the HMG 4000
OF_THE_LOGGER = {
    "logger_rate": lambda: param(
        "frequency", 1.0 / SAMPLE, 1e6, "Rows that the logger records per second, of all channels at once", LOGGER_RATE
    ),
    "hum_frequency": lambda: param("frequency", 1.0, 1e3, "Frequency of the mains"),
    "anti_alias": lambda: param(
        "frequency", 0.0, 1e5, "Corner frequency of the analog channels' low pass; at 0 there is none", 0.0
    ),
    "resolution_bits": lambda: param(
        "ratio", 0.0, 32.0, "Bits into which the analog channels' converter cuts the range; at 0 it cuts nothing", 0.0
    ),
}


@lru_cache(maxsize=32)
def instruments_class(pairs: tuple[tuple[str, str], ...]) -> type:
    """Return the dataclass of a rig's instruments.

    Parameters
    ----------
    pairs : tuple of (str, str)
        The pairs (like, type) of the transducers.

    Returns
    -------
    type
        A dataclass with the fields ``<like>_<what>`` of each pair and the fields of the logger.
    """
    out = [(f"{like}_{what}", float, one) for like, of in pairs for what, one in TRANSDUCER_TYPES[of].errors().items()]
    out += [(name, float, one()) for name, one in OF_THE_LOGGER.items()]

    def reduce(self: DataclassInstance) -> tuple:  # so that a process can send one to another
        return _instruments, (pairs, tuple(getattr(self, one.name) for one in fields(self)))

    return make_dataclass(
        "InstrumentsConfig",
        out,
        frozen=True,
        kw_only=True,
        namespace={"__doc__": "Of each transducer: noise, range, class, disturbances.", "__reduce__": reduce},
    )


def _instruments(pairs: tuple[tuple[str, str], ...], values: Iterable[float]) -> object:
    cls = instruments_class(pairs)
    return cls(**dict(zip((one.name for one in fields(cls)), values, strict=True)))


def instruments_of(structure: Structure) -> type:
    """Return the dataclass of the instruments of a rig."""
    return instruments_class(tuple(dict.fromkeys((one.like, one.type) for one in structure.transducers)))
