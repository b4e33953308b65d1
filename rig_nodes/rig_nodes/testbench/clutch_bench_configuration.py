# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The clutch bench, and the spring and cylinder benches made of its parts, from their YAML (thesis chapter 8).

Used by testbench.configuration, which reads every rig; the numbers go to testbench.clutch_bench.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path

from ..config.names import unknown_value
from ..config.schema import build, changed, check_keys, field_value, param, switch, where_of
from ..errors import RigError, brief
from ..parts.hydraulic_motor import HydraulicMotorConfig
from ..parts.oil_supply import OilSupplyConfig
from ..parts.plates import PackFriction, PlatePack
from ..parts.press_cylinder import PressCylinder
from .timed import KernelConfig

KIND = "clutch_bench"


@dataclass(frozen=True)
class BenchShaft:
    """Torque meter, which joins motor and shaft (fig. 8.4), and the shaft with the inner plates."""

    inertia: float = param("inertia", 1e-4, 10.0)
    meter_stiffness: float = param("torque per angle", 1e2, 1e7)
    meter_damping: float = param("torque per speed", 0.0, 1e4)


@dataclass(frozen=True)
class BenchInstruments:
    """Of each transducer: noise (standard deviation), range, class, hum, as in InstrumentsConfig of the gearbox's rig.

    pressure: of p_z and p_sh. force_fitted: whether PS or the testing machine measures the force.
    """

    torque_noise: float = param("torque", 0.0, 100.0)
    torque_range: float = param("torque", 1.0, 1e5)
    torque_class: float = param("ratio", 0.0, 0.1)
    torque_hum: float = param("torque", 0.0, 100.0)
    speed_noise: float = param("angular velocity", 0.0, 100.0)
    speed_range: float = param("angular velocity", 0.1, 1e5)
    speed_step: float = param("angular velocity", 0.0, 10.0)
    speed_gate: float = param("time", 1e-6, 0.1)
    pressure_noise: float = param("pressure", 0.0, 1e6)
    pressure_range: float = param("pressure", 1e5, 1e9)
    pressure_class: float = param("ratio", 0.0, 0.1)
    pressure_hum: float = param("pressure", 0.0, 1e6)
    travel_noise: float = param("length", 0.0, 1e-3)
    travel_range: float = param("length", 1e-4, 1.0)
    travel_class: float = param("ratio", 0.0, 0.1)
    force_noise: float = param("force", 0.0, 1e4)
    force_range: float = param("force", 1.0, 1e6)
    force_class: float = param("ratio", 0.0, 0.1)
    force_fitted: bool = switch()
    temperature_range: float = param("temperature", 1.0, 1e3)
    temperature_offset: float = param("temperature", 0.0, 10.0)
    temperature_gain: float = param("ratio", 0.0, 0.1)
    hum_frequency: float = param("frequency", 1.0, 1e3)
    anti_alias: float = param("frequency", 0.0, 1e5)
    resolution_bits: float = param("ratio", 0.0, 32.0)


@dataclass(frozen=True)
class BenchEffects:
    """What can be switched off to show its effect; transducers off: the true values are logged."""

    seal_friction: bool = switch()
    plate_heat: bool = switch()
    transducers: bool = switch()


PARTS = {
    "hydraulic_motor": HydraulicMotorConfig, "shaft": BenchShaft, "oil_supply": OilSupplyConfig,
    "cylinder": PressCylinder, "plate_pack": PlatePack, "pack": PackFriction, "instruments": BenchInstruments,
    "effects": BenchEffects,
}


@dataclass(frozen=True)
class ClutchBenchConfig:
    """A whole bench. oil_supply: of the cylinder (pump P_1, valve ZP_1), its oil is that of the whole bench."""

    name: str
    kernel: KernelConfig
    hydraulic_motor: HydraulicMotorConfig
    shaft: BenchShaft
    oil_supply: OilSupplyConfig
    cylinder: PressCylinder
    plate_pack: PlatePack
    pack: PackFriction
    instruments: BenchInstruments
    effects: BenchEffects

    kind = KIND
    cut_out = ()  # no device of it can stand outside

    def as_dict(self) -> dict:
        """Plain SI values, for the run's record in bag and report."""
        return {"kind": KIND, "name": self.name, **{name: asdict(getattr(self, name)) for name in ("kernel", *PARTS)}}


def whole(node, path) -> ClutchBenchConfig:
    """A bench that names all its values; RigError with file and line otherwise."""
    keys = ("description", "kind", "step", *PARTS)
    check_keys(path, node, keys, keys, "the rig")
    if node["kind"] != KIND:
        raise RigError(f"{where_of(path, node, 'kind')}: kind is {brief(node['kind'])}, expected {KIND}; a rig with the "
                       "gearbox has none")
    kernel = build(KernelConfig, node, path, "the rig", others=keys)
    return ClutchBenchConfig(Path(path).stem, kernel,
                             **{part: build(cls, node[part], path, part, where=where_of(path, node, part)) for part, cls in PARTS.items()})


def on_base(config: ClutchBenchConfig, node, path) -> ClutchBenchConfig:
    """A bench that names what differs from the one that it stands on."""
    check_keys(path, node, ("description", "base", *PARTS), ("description", "base"), "a bench on a base")
    return replace(config, **{part: changed(getattr(config, part), node[part], path, part, where_of(path, node, part))
                              for part in PARTS if part in node})


def with_overrides(config: ClutchBenchConfig, overrides: dict[str, str]) -> ClutchBenchConfig:
    """The bench with some values changed, e.g. {"plate_pack.surfaces": "12 -"}; RigError for those that do not fit."""
    for key, text in overrides.items():
        where = f"setting {key}={text}"
        part, _, name = key.partition(".")
        owner = getattr(config, part) if part in ("kernel", *PARTS) else None
        if owner is None or name not in type(owner).__dataclass_fields__:
            known = {one: list(type(getattr(config, one)).__dataclass_fields__) for one in ("kernel", *PARTS)}
            raise RigError(f"{where}: {unknown_value(key, known)}")
        value = field_value(type(owner).__dataclass_fields__[name], text, f"{where}: the value")
        config = replace(config, **{part: replace(owner, **{name: value})})
    return config
