# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the operator's page is told of a rig, from the rig's own description: signals, gears, settings, faults, its picture.

nodes.panel.panel sends it to every page. Nothing here knows a certain rig.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analysis import LOGGER
from ...base import SWITCH, RigError, load_yaml, with_bases
from ...plant import part as parts
from ...rig import (
    CONTROLLER,
    CONTROLLER_COMMAND,
    OUTPUT_KEYS,
    OWN,
    build_driveline,
    config_of_record,
    driveline_drawn,
    driveline_svg,
    faults_of,
    inertias_of,
    own_setting,
    shown_unit,
)
from ..running_rig import read_in
from .composed import steps_of
from .loads import Load, loads_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from ...rig import RigConfig, Setting, Signal, Topic

FALLBACK = 4  # signals that the charts show at first, for a rig without gears
SURE = 1e-9  # of a weight that is rounding


class Description:
    """A rig as the page needs it.

    Attributes
    ----------
    config : RigConfig
        The rig's configuration, from the record that it publishes.
    record : mapping
        That record.

    Parameters
    ----------
    record : mapping
        The record of its configuration; RigError when it is of another version.
    rig : str
        Name or folder of the rig, which finds its sequences; empty for the name in the record.
    """

    def __init__(self, record: Mapping, rig: str = "") -> None:
        config = config_of_record(record, "the rig that runs")
        self.record, self._files = record, files_of(rig or config.name)
        text = str(self._files[0][1].get("description", "")) if self._files else ""  # which a record does not hold
        self.config: RigConfig = replace(config, description=text)

    @property
    def live(self) -> dict[str, Setting]:
        """The settings that may change while the rig runs, by name."""
        return {name: one for name, one in self.config.settings.items() if one.live and not one.lacking}

    def setting(self, name: str) -> Setting:
        """Return a setting by its name, which may be one of the controller's own; RigError when there is none."""
        if name.startswith(f"{CONTROLLER}.{OWN}"):
            return own_setting(name)
        if name in self.loads:
            return self.loads[name].torque
        found = self.config.settings.find(name)
        found.check_lives()
        return found

    @cached_property
    def whole(self) -> dict[str, Any]:
        """Everything that does not change while the rig runs, ready for JSON."""
        config, torques = self.config, [one.torque for one in self.loads.values()]
        return {
            "name": config.name,
            "text": config.description,
            "controller": CONTROLLER if self.shifts else "",
            "signals": [self._signal(one) for one in config.catalogue.signals.values()],
            "chart": self._charts(),
            "gears": [{"number": number, "name": name} for number, name in config.transmission.names.items()]
            if self.shifts
            else [],
            "settings": [described(one) for one in (*torques, *self.live.values()) if one.numbers == 1],
            "outputs": self._outputs(),
            "delays": [name for name, one in self.live.items() if one.owner == CONTROLLER and one.unit == "s" and one.low < 0.0],
            "faults": [self._fault(one) for one in faults_of(config).values()] if config.faults is not None else [],
            "sequences": [{"name": name, "text": text} for name, (_, text) in self._installed("sequences").items()],
            "procedures": [{"name": name, "text": text} for name, (_, text) in self._installed("procedures").items()],
            "drive": self._drive(),
            "steps": steps_of(config, self.loads, self._drive()),
            "picture": self._picture(),
        }

    @cached_property
    def loads(self) -> dict[str, Load]:
        """The loads that are given as a torque too, by the names of these."""
        return loads_of(self.config)

    def topics(self) -> tuple[list[Topic], set[str]]:
        """Return the topics that the page needs, and the names of those that the figure of a shift needs without gaps."""
        known, whole = self.config.catalogue, {LOGGER}
        shown = {one.topic for one in known.signals.values()}
        wanted = [one for one in known.topics.values() if one.name in shown | whole or not one.rate]
        wanted += known.controller_topics.values()
        if self.shifts:
            whole |= {one.state for one in self.config.transmission.clutches} | {CONTROLLER_COMMAND}
        return wanted, whole

    @property
    def procedures(self) -> dict[str, Path]:
        """The files of the rig's procedures by name."""
        return {name: path for name, (path, _) in self._installed("procedures").items()}

    def _installed(self, kind: str) -> dict[str, tuple[Path, str]]:
        """The sequences or procedures of the rig and of those it is based on by name: their files and lines of text."""
        found: dict[str, tuple[Path, str]] = {}
        for path in (path for file, _ in self._files for path in sorted((file.parent / kind).glob("*.yaml"))):
            try:
                content = load_yaml(path)
                text = str(content.get("description", "")) if isinstance(content, dict) else ""
            except RigError as error:  # one that somebody is writing
                text = f"it cannot be read: {error}"
            found.setdefault(path.stem, (path, text))
        return found

    def _drive(self) -> list[dict[str, str]]:
        """The nodes that take setpoints, in the order in which a first shift needs them, each with what it is for people."""
        order = {parts.OIL: 0, parts.SOURCE: 1, parts.LOAD: 2}
        nodes = dict.fromkeys(one.owner for one in self.live.values() if one.setpoint)
        roles = {node: self.config.structure.device(self._device(node)).role for node in nodes}
        ranked = sorted(nodes, key=lambda node: order.get(roles[node], len(order)))
        return [{"node": node, "role": roles[node] if roles[node] in order else ""} for node in ranked]

    def _device(self, node: str) -> str:
        return next(one.setpoint.device for one in self.live.values() if one.owner == node and one.setpoint)

    @property
    def shifts(self) -> bool:
        """Whether the rig has a shift controller."""
        return CONTROLLER_COMMAND in self.config.catalogue.topics

    @staticmethod
    def _signal(one: Signal) -> dict[str, Any]:
        ends = [one.low * one.scale, one.high * one.scale]
        return {
            "name": one.name,
            "unit": one.display_unit,
            "low": min(ends),
            "high": max(ends),
            "text": one.text,
            "states": {str(value): word for value, word in one.states.items()},
        }

    def _charts(self) -> list[list[str]]:
        """Signals of the charts that a new page begins with: speeds, torques, pressures of a gearbox, else what is measured."""
        known = self.config.catalogue.signals
        if self.shifts:
            box = self.config.transmission
            rows = [
                [box.input.speed, box.output.speed],
                [box.input.torque, box.output.torque],
                [one.pressure for one in box.clutches],
                [one.setpoint for one in box.clutches],
            ]
            return [[name for name in row if name in known] for row in rows]
        return [[name] for name in list(self.config.catalogue.measured().values())[:FALLBACK]]

    def _outputs(self) -> list[dict[str, Any]]:
        """The outputs of the controller that drive valves, with the clutches that these fill."""
        if not self.shifts or f"{CONTROLLER}.{OUTPUT_KEYS[0]}.times" not in self.config.settings:
            return []
        limit = float(self.config.alfa46.values.current_limit)
        fills = {one.output: one.name for one in self.config.transmission.clutches}
        return [
            {"key": f"{CONTROLLER}.{key}", "output": k + 1, "name": fills.get(k, ""), "limit": limit}
            for k, key in enumerate(OUTPUT_KEYS)
        ]

    @staticmethod
    def _fault(one: Any) -> dict[str, Any]:
        size = one.fault.size
        unit, factor = shown_unit(size.quantity) if size else ("", 1.0)
        return {
            "name": one.name,
            "text": one.fault.text,
            "sign": one.fault.sign,
            "size": size.text if size else "",
            "unit": unit,
            "low": size.low / factor if size else 0.0,
            "high": size.high / factor if size else 0.0,
            "usual": size.usual / factor if size else 0.0,
            "lacking": one.lacking,
        }

    # ---- the picture

    def _picture(self) -> dict[str, Any]:
        """The driveline as SVG, and what is shown at each of its bodies and joints, both in the order of their elements."""
        bodies, links = driveline_drawn(self.config)
        structure, known = self.config.structure, self.config.catalogue.signals
        speeds = self._speeds([one.name for one in bodies])
        joined: dict[tuple[str, frozenset[str]], list[str]] = {}  # by kind and ends: several may join the same two
        for one in structure.devices:
            kind = "clutch" if one in structure.clutches else "freewheel" if one in structure.freewheels else ""
            if kind and "joins" in one.wires:
                joined.setdefault((kind, frozenset(map(str, one.wires["joins"]))), []).append(one.name)
        braked: dict[str, list[str]] = {}
        for one in structure.clutches:
            if "brakes" in one.wires:
                braked.setdefault(str(one.wires["brakes"]), []).append(one.name)
        joints = []
        for one in links:  # in the order of the devices, as joined has them
            names = joined.get((one.kind, frozenset((one.a, one.b))), [])
            clutch = self._clutch(names.pop(0)) if names else None
            shaft = next((t.name for t in structure.transducers if one.kind == "shaft" and t.shows == f"{one.text}.torque"), None)
            torque = clutch.get("torque") if clutch else shaft
            joints.append({"kind": one.kind, "a": one.a, "b": one.b, "clutch": clutch, "torque": torque})
        return {
            "svg": driveline_svg(self.config),
            "bodies": [
                {
                    "name": one.name,
                    "speed": speeds.get(one.name),
                    "torque": self._torque_on(one.name, known),
                    "brakes": [self._clutch(name) for name in braked.get(one.name, [])],
                    "braked": bool(one.brake),
                }
                for one in bodies
            ],
            "links": joints,
        }

    def _clutch(self, name: str) -> dict[str, str]:
        """Signals of a clutch or free-wheel by what they show; those that the rig has not are left out."""
        known, key = self.config.catalogue.signals, self.config.structure.device(name).key
        named = self.config.structure.names
        found = {what: named.get(f"{key}_{what}", f"{key}_{what}") for what in ("mode", "torque", "slip", "capacity")}
        if self.shifts:
            for one in self.config.transmission.clutches:
                if one.instance == name:
                    found |= {"pressure": one.pressure, "current": one.setpoint}
        return {what: signal for what, signal in found.items() if signal in known} | {
            "called": self.config.structure.device(name).called
        }

    def _torque_on(self, body: str, known: Mapping[str, Signal]) -> list[str]:
        """Torque signals of the devices that sit on a body."""
        structure, named = self.config.structure, self.config.structure.names
        names = [f"{one.key}_torque" for one in structure.devices if one.wires.get("body") == body]
        return [name for name in (named.get(one, one) for one in names) if name in known]

    def _speeds(self, names: Iterable[str]) -> dict[str, list[tuple[str, float]]]:
        """Return the speed of each body [rad/s] as a sum of signals with weights, as far as signals determine it.

        Speeds v of the driveline follow by least squares from measured speeds and slips, which are linear in v
        (driveline.System: ``bodies_from_speeds`` and ``w``), with the twist of shafts left out.
        """
        config, known = self.config, self.config.catalogue.signals
        values = config.as_dict()
        system = build_driveline(config.structure, inertias_of(config.structure, values), values, lossless=True)
        rows, signals = [], []
        for one in config.structure.transducers:
            body = one.shows.removesuffix(".speed")
            if body in system.bodies and one.shows.endswith(".speed"):
                rows.append(system.bodies_from_speeds[system.bodies.index(body)])
                signals.append(one.name)
        for one in config.structure.devices:
            name = config.structure.names.get(f"{one.key}_speed", f"{one.key}_speed")
            if one.wires.get("body") in system.bodies and name in known:
                rows.append(system.bodies_from_speeds[system.bodies.index(str(one.wires["body"]))])
                signals.append(name)
            slip = config.structure.names.get(f"{one.key}_slip", f"{one.key}_slip")
            if one.name in system.elements and slip in known:
                rows.append(system.w[system.elements.index(one.name)])
                signals.append(slip)
        stiff = list(system.sh[: len(system.shafts)])  # both ends of a shaft turn alike but for its twist
        if not rows:
            return {}
        matrix = np.array([*rows, *stiff])
        inverse = np.linalg.pinv(matrix, rcond=SURE)
        seen = inverse @ matrix  # the identity in the directions that are determined
        out = {}
        for name in names:
            way = system.bodies_from_speeds[system.bodies.index(name)]
            if np.allclose(way @ seen, way, atol=1e-6):
                weights = (way @ inverse)[: len(signals)]
                out[name] = [(signal, float(weight)) for signal, weight in zip(signals, weights) if abs(weight) > SURE]
        return out


def described(one: Setting) -> dict[str, Any]:
    """Return what a page needs to show and to change a setting: words, unit that people read, and range in it."""
    if one.dimension == SWITCH:
        return {"name": one.name, "text": one.text, "kind": "switch", "setpoint": one.setpoint is not None}
    unit, scale = read_in(one.unit)
    low, high = (value * scale if math.isfinite(value) and abs(value) < 1e14 else None for value in (one.low, one.high))
    return {
        "name": one.name,
        "text": one.text,
        "kind": "number",
        "unit": unit,
        "scale": scale,
        "low": low,
        "high": high,
        "setpoint": one.setpoint is not None,
    }


def files_of(rig: str) -> list[tuple[Path, Mapping]]:
    """Return the file of a rig, given by name or folder, and those of its bases; none for one that is installed elsewhere."""
    try:
        return [(path, content) for path, content in with_bases(rig) if isinstance(content, dict)]
    except RigError:
        return []
