# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rig from its YAML: every part's values, checked before anything starts.

Used by every verb that needs a rig; the numbers go to testbench.rig, their record into the bag.
"""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

from ..alfa46 import law
from ..alfa46.settings import OUTPUT_KEYS, POINTS, Alfa46Config, read_alfa46
from ..catalogue import GEARBOX
from ..clocks import SAMPLE
from ..config.names import beside, find_config, unknown_value, with_bases
from ..config.schema import build, changed, check_keys, field_value, param, where_of
from ..config.units import quantity
from ..errors import RigError, brief
from ..parts.dc_motor import MotorConfig
from ..parts.load_pump import LoadConfig
from ..parts.oil_supply import OilSupplyConfig
from ..parts.plates import PlatePack
from ..parts.proportional_valve import ValveConfig
from ..parts.wet_clutch import Cylinder
from ..engine.outside import CUTTABLE, NOT_CUT, why_not
from . import clutch_bench_configuration as clutch_bench
from .clutch_bench_configuration import ClutchBenchConfig
from .effects import EffectsConfig
from .gearbox_configuration import GearboxConfig
from .instruments_configuration import InstrumentsConfig
from .prescribed import Prescribed, read_prescribed
from .timed import KernelConfig
from .together import check_together


@dataclass(frozen=True)
class CutConfig:
    """The tick for which both sides of a cut hold what the other one gave."""

    tick: float = param("time", SAMPLE, 1e-2)


SOURCES = ("plant", "topic")
PARTS = {
    "motor": MotorConfig, "gearbox": GearboxConfig, "plate_pack": PlatePack, "clutch_s1": Cylinder,
    "clutch_s2": Cylinder, "valve_zr_p1": ValveConfig, "valve_zr_p2": ValveConfig, "oil_supply": OilSupplyConfig,
    "load_pump": LoadConfig, "instruments": InstrumentsConfig, "effects": EffectsConfig,
}
VALVES = ("valve_zr_p1", "valve_zr_p2")
_POINT_KEY = re.compile(rf"alfa46\.({'|'.join(OUTPUT_KEYS)})\.({'|'.join(POINTS)})")
_POINT = re.compile(r"\s*([-+\d.eE]+\s*[a-zA-Z]+)[\s,]+([-+\d.eE]+\s*[a-zA-Z]+)\s*")


@dataclass(frozen=True)
class RigConfig:
    """A whole rig with the gearbox. wiring: index of the controller's output that drives each valve; cut_out: devices
    outside the plant, reached through topics (engine.outside).
    """

    name: str
    kernel: KernelConfig
    wiring: tuple[int, int]
    motor: MotorConfig
    gearbox: GearboxConfig
    plate_pack: PlatePack
    clutch_s1: Cylinder
    clutch_s2: Cylinder
    valve_zr_p1: ValveConfig
    valve_zr_p2: ValveConfig
    oil_supply: OilSupplyConfig
    load_pump: LoadConfig
    instruments: InstrumentsConfig
    effects: EffectsConfig
    alfa46: Alfa46Config
    cut: CutConfig = CutConfig(SAMPLE)
    cut_out: tuple[str, ...] = ()
    prescribed: Prescribed | None = None

    kind = GEARBOX

    def as_dict(self) -> dict:
        """Plain SI values, for the run's record in bag and report; ``cut`` only where a device is cut out."""
        out = {name: asdict(getattr(self, name)) for name in ("kernel", *PARTS)}
        if self.cut_out:
            out["cut"] = {**asdict(self.cut), "devices": list(self.cut_out)}
        if self.prescribed:
            out["prescribed"] = self.prescribed.as_dict()
        return {"name": self.name, "wiring": list(self.wiring), **out, "alfa46": self.alfa46.as_dict()}


def _wiring(rig, path) -> tuple[int, int]:
    node = rig["wiring"]
    check_keys(path, node, VALVES, VALVES, "wiring", where_of(path, rig, "wiring"))
    outputs = []
    for valve in VALVES:
        output = node[valve]
        if not isinstance(output, int) or isinstance(output, bool) or not 1 <= output <= law.OUTPUTS:
            raise RigError(f"{where_of(path, node, valve)}: wiring.{valve} is {brief(output)}, expected output 1 to "
                           f"{law.OUTPUTS} of the controller")
        outputs.append(output - 1)
    if outputs[0] == outputs[1]:
        raise RigError(f"{where_of(path, node)}: wiring gives both valves the same output")
    return outputs[0], outputs[1]


def _check_tick(cut: CutConfig, where: str) -> None:
    samples = cut.tick / SAMPLE
    if abs(samples - round(samples)) > 1e-9:
        raise RigError(f"{where}: a tick of {cut.tick * 1e3:g} ms is no whole number of samples of "
                       f"{SAMPLE * 1e3:g} ms; give e.g. 1 ms or 5 ms")


def _with_source(cut_out: tuple[str, ...], device: str, source, where: str) -> tuple[str, ...]:
    """cut_out with a device's source set to plant or topic."""
    if source not in SOURCES:
        raise RigError(f"{where}: source is {brief(source)}, expected {' or '.join(SOURCES)}")
    if source == "topic" and (why := why_not(device)):
        raise RigError(f"{where}: {why}")
    wanted = {*cut_out, device} if source == "topic" else {*cut_out} - {device}
    return tuple(name for name in CUTTABLE if name in wanted)


def _whole(node, path) -> RigConfig:
    """A rig that names all its values."""
    keys = ("description", "controller", "step", "wiring", *PARTS)
    check_keys(path, node, [*keys, "cut"], keys, "the rig")
    kernel = build(KernelConfig, node, path, "the rig", others=(*keys, "cut"))
    parts, cut_out = {}, ()
    for part, cls in PARTS.items():
        is_device = part in CUTTABLE or part in NOT_CUT
        parts[part] = build(cls, node[part], path, part, ("source",) if is_device else (), where_of(path, node, part))
        if is_device and "source" in node[part]:
            where = f"{where_of(path, node[part], 'source')}: {part}"
            cut_out = _with_source(cut_out, part, node[part]["source"], where)
    cut = CutConfig(SAMPLE)
    if "cut" in node:
        cut = build(CutConfig, node["cut"], path, "cut", where=where_of(path, node, "cut"))
        _check_tick(cut, f"{where_of(path, node['cut'], 'tick')}: cut.tick")
    return RigConfig(name=Path(path).stem, kernel=kernel, wiring=_wiring(node, path),
                     alfa46=_controller(node, path), cut=cut, cut_out=cut_out, **parts)


def _controller(node, path) -> Alfa46Config:
    """The settings that a rig's ``controller`` names: installed ones, or a file beside the rig's."""
    try:
        controller = find_config("controllers", beside(path, node["controller"]))
    except RigError as error:
        raise RigError(f"{where_of(path, node, 'controller')}: controller: {error}") from None
    return read_alfa46(controller)


def _on_base(config, node, path) -> RigConfig | ClutchBenchConfig:
    """A rig that names another one, which is read already, and what differs from it."""
    config = replace(config, name=Path(path).stem)
    if config.kind == clutch_bench.KIND:
        return clutch_bench.on_base(config, node, path)
    check_keys(path, node, ("description", "base", "controller", "controller_values", "prescribed", *PARTS),
               ("description", "base"), "a rig on a base")
    for part in PARTS:
        if part in node:
            config = replace(config, **{part: changed(getattr(config, part), node[part], path, part,
                                                 where_of(path, node, part))})
    if "controller" in node:
        config = replace(config, alfa46=_controller(node, path))
    if "controller_values" in node:
        values = changed(config.alfa46.values, node["controller_values"], path, "controller_values",
                         where_of(path, node, "controller_values"))
        config = replace(config, alfa46=Alfa46Config(values, config.alfa46.profiles))
    if "prescribed" in node:
        config = replace(config, prescribed=read_prescribed(node["prescribed"], path))
    return config


def _where_written(node, path, keys: tuple[str, ...]) -> str:
    """``file:line`` of the first of these keys that a rig's map names itself."""
    for part, _, name in (key.partition(".") for key in keys):
        own = node.get("controller_values" if part == "alfa46" else part)
        if isinstance(own, dict) and name in own:
            return f"{where_of(path, own, name)}: "
    return f"{path}: "


def load_rig(name: str | Path = "hydmag", overrides: dict[str, str] | None = None) -> RigConfig | ClutchBenchConfig:
    """The rig of this name or file, with the gearbox unless its ``kind`` or that of its base says another.

    ``overrides``: e.g. {"alfa46.t12": "200 ms", "wiring": "swapped", "alfa46.output_1.P1": "200 ms 160 mA"}.
    """
    config = None
    for path, node in reversed(with_bases(name)):
        if config is not None:
            config = _on_base(config, node, path)
        elif isinstance(node, dict) and "kind" in node:
            config = clutch_bench.whole(node, path)
        else:
            config = _whole(node, path)
        check_together(config, partial(_where_written, node, path))
    return with_overrides(config, overrides or {})


def load_gearbox_rig(name: str | Path, overrides: dict[str, str] | None, what: str) -> RigConfig:
    """As :func:`load_rig`, for what works with the gearbox's rig only; RigError for another kind."""
    config = load_rig(name, overrides)
    if config.kind != GEARBOX:
        raise RigError(f"{what} is for a rig with the gearbox; '{config.name}' is a {config.kind.replace('_', ' ')}")
    return config


def with_overrides(config, overrides: dict[str, str], together: bool = True):
    """The rig with some values changed, as :func:`load_rig` takes them; RigError for those that do not fit.

    together: they are all, and must fit each other too.
    """
    if config.kind == clutch_bench.KIND:
        config = clutch_bench.with_overrides(config, overrides)
    else:
        points = {}
        for key, text in overrides.items():
            if match := _POINT_KEY.fullmatch(key):
                points[match.groups()] = text
            else:
                config = _override(config, key, text)
        config = _with_points(config, points)
    if overrides and together:
        check_together(config, lambda keys: next((f"setting {k}={overrides[k]}: " for k in keys if k in overrides), ""))
    return config


def _with_points(config: RigConfig, points: dict[tuple[str, str], str]) -> RigConfig:
    """The rig with points (output, P1 to P6) of the controller's profiles moved; check_together looks at the whole."""
    profiles = config.alfa46.profiles.copy()
    for (output, point), text in points.items():
        where = f"setting alfa46.{output}.{point}={text}"
        parts = _POINT.fullmatch(text) if len(text) < 80 else None
        if parts is None:
            raise RigError(f"{where}: expected time and current, e.g. \"200 ms 160 mA\"")
        profiles[OUTPUT_KEYS.index(output), POINTS.index(point)] = (
            quantity(parts[1], "time", where), quantity(parts[2], "current", where))
    return replace(config, alfa46=Alfa46Config(config.alfa46.values, profiles))


def _override(config: RigConfig, key: str, text: str) -> RigConfig:
    where = f"setting {key}={text}"
    if key == "wiring":
        if text != "swapped":
            raise RigError(f"{where}: the only other wiring is 'swapped'")
        return replace(config, wiring=config.wiring[::-1])
    part, _, name = key.partition(".")
    if name == "source" and part in (*CUTTABLE, *NOT_CUT):
        return replace(config, cut_out=_with_source(config.cut_out, part, text, where))
    own = ("kernel", "cut", *PARTS)
    owner = config.alfa46.values if part == "alfa46" else getattr(config, part) if part in own else None
    if owner is None or name not in type(owner).__dataclass_fields__:
        known = {one: list(type(getattr(config, one)).__dataclass_fields__) for one in own}
        known["alfa46"] = [*type(config.alfa46.values).__dataclass_fields__,
                           *(f"{output}.{point}" for output in OUTPUT_KEYS for point in POINTS)]
        for device in CUTTABLE:
            known[device].append("source")
        raise RigError(f"{where}: {unknown_value(key, known)}")
    value = field_value(type(owner).__dataclass_fields__[name], text, f"{where}: the value")
    owner = replace(owner, **{name: value})
    if part == "cut":
        _check_tick(owner, where)
    if part == "alfa46":
        return replace(config, alfa46=Alfa46Config(owner, config.alfa46.profiles))
    return replace(config, **{part: owner})
