# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of a rig: what of it can have which, and orders of them as people write them.

runs.faults has the orders act; sequences, the command line and the API read them here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..base import (
    SAMPLE,
    UNITS,
    RigError,
    brief,
    check_keys,
    find_of_rigs,
    load_yaml,
    number_text,
    quantity,
    shown_in,
    span,
    unknown,
    where_of,
)
from ..plant import GROWING, INTERMITTENT, LINES, ONSETS, TRANSDUCER, Fault, faults, uniform
from .alfa46 import OUTPUT_KEYS
from .quantities import DIMENSIONS
from .settings import CONTROLLER

if TYPE_CHECKING:
    from pathlib import Path

    from .configuration import RigConfig

RANDOM, DRAWS = "random", 1 << 34  # in place of an order, and number of the first channel of the values that draw it
FAULT_ON, FAULT_OFF, FAULT_ORDERED = "fault_on", "fault_off", "fault_ordered"  # names of the rig's events
FAULTS = "faults"  # key of the orders that a run begins with, among the changed values of a rig
ENABLED, FAULTS_APART = "on", ";"  # without orders, and what stands between two
KEYS = ("name", "size", "onset", "over", "period", "share", "at", "when", "for", "off")
OVER, PERIOD, SHARE = 5.0, 0.2, 0.5  # s, s and a share: of a fault that grows or comes and goes, where an order does not say
LEAST_PERIOD, LONGEST_TIME = 2e-3, 86_400.0  # s: two samples, and a day
HOW = 'enable them with --faults, or in Python by rig_nodes.load(NAME, faults="on")'
ABOVE, BELOW = "above", "below"
# units in which people read sizes, where it is not the SI unit
SHOWN = {"length": "mm", "area": "mm2", "pressure": "MPa", "ratio": "%", "time": "ms", "hydraulic resistance": "bar/(l/min)"}


@dataclass(frozen=True)
class FaultOfRig:
    """A fault that something of a rig can have.

    Parameters
    ----------
    name : str
        Name in orders: of the device, transducer, messages or output of the Alfa46, and of the fault.
    owner : str
        The former.
    fault : Fault
        The type.
    spn : int
        Suspect parameter number of SAE J1939-73.
    configs : tuple of object
        What Fault.lacks and Target.configs take.
    lacking : str
        Why the rig as it is refuses it; empty when it does not.
    """

    name: str
    owner: str
    fault: Fault
    spn: int
    configs: tuple[Any, ...]
    lacking: str = ""


@dataclass(frozen=True)
class Trigger:
    """A signal from low to high [SI], at which a fault begins."""

    signal: str
    low: float
    high: float


@dataclass(frozen=True)
class FaultOrder:
    """An order of a fault, checked.

    Parameters
    ----------
    text : str
        As people write it.
    of : FaultOfRig
        The fault.
    size : float
        Its full size [SI]; 1 for a fault without one.
    onset : str
        One of plant.ONSETS.
    over : float
        Time in which a growing fault reaches its size [s].
    period, share : float
        Period of an intermittent one [s], and the share of it in which it acts.
    at : float
        Time from the order to the beginning [s].
    when : Trigger or None
        What is awaited after that.
    lasts : float
        Time from the beginning to the end [s]; infinite for one that stays.
    off : bool
        True for the end of what was ordered under this name.
    """

    text: str
    of: FaultOfRig
    size: float
    onset: str
    over: float
    period: float
    share: float
    at: float
    when: Trigger | None
    lasts: float
    off: bool

    @property
    def shown_size(self) -> str:
        """The size with its unit, as people read it; empty for a fault without one."""
        size = self.of.fault.size
        if size is None:
            return ""
        unit, factor = shown_unit(size.quantity)
        return f"{number_text(self.size / factor, apart=' ')} {unit}"

    def sentence(self) -> str:
        """Return the text of its event: name, parameter with size and unit, onset."""
        size = self.of.fault.size
        what = (
            f": {size.text} {self.shown_size}"
            if size is not None
            else f": {self.of.fault.text[0].lower()}{self.of.fault.text[1:-1]}"
        )
        return f"{self.of.name}{what}, {self.onset}"


def shown_unit(quantity: str) -> tuple[str, float]:
    """Return the unit in which people read the size of a fault, and its factor to SI."""
    unit = SHOWN.get(quantity)
    return (unit, UNITS[unit][1]) if unit else shown_in(quantity)


def faults_of(config: RigConfig) -> dict[str, FaultOfRig]:
    """Return every fault that something of a rig can have, by its name in orders; those that the rig refuses have the reason."""
    found, structure = {}, config.structure
    for fault in faults().values():
        for k, (owner, configs, why) in enumerate(_owners(config, fault)):
            name = f"{owner}.{fault.name}"
            off = bool(fault.effect) and not getattr(config.effects, fault.effect)
            why = why or (f"effects.{fault.effect} is off, so it would change nothing" if off else fault.lacks(configs))
            found[name] = FaultOfRig(name, owner, fault, fault.spn + k, configs, why)
    owners = [*(one.name for one in structure.devices), *_names(config), *OUTPUT_KEYS, *LINES]
    order = {name: k for k, name in enumerate(owners)}
    return dict(sorted(found.items(), key=lambda one: order[one[1].owner]))


def _names(config: RigConfig) -> list[str]:
    return [one.name for one in config.structure.transducers]


def _owners(config: RigConfig, fault: Fault) -> list[tuple[str, tuple[Any, ...], str]]:
    """What of a rig a type of fault acts on: name, configuration, and why it cannot be."""
    structure = config.structure
    if fault.part in LINES:
        return [(fault.part, (), "")] if structure.shifts else []
    prescribed = "the rig's pressures are prescribed" if config.prescribed else ""
    if fault.part == CONTROLLER:
        driven = {valve.wires["output"] - 1 for valve in structure.valves if structure.shifts}
        return [(key, (), prescribed) for k, key in enumerate(OUTPUT_KEYS) if k in driven]
    if fault.part == TRANSDUCER:
        off = "" if config.effects.transducers else "effects.transducers is off, so that true values are shown"
        return [
            (one.name, (getattr(config.instruments, f"{one.like}_step", 0.0) > 0.0, _next_like(config, one.name)), off)
            for one in structure.transducers
            if getattr(config.instruments, f"{one.like}_fitted", True)
        ]
    return [
        (
            device.name,
            tuple(map(config.values, (device.name, *(device.wires[to] for to in ("plates", "press") if to in device.wires)))),
            "it stands outside the plant" if device.name in config.cut_out else prescribed,
        )
        for device in structure.devices
        if device.part == fault.part
    ]


def _next_like(config: RigConfig, name: str) -> str:
    """Return the next transducer of the same type, the first one after the last; empty when there is no other."""
    kinds = {one.name: one.type for one in config.structure.transducers}
    like = [other for other in kinds if kinds[other] == kinds[name]]
    return like[(like.index(name) + 1) % len(like)] if len(like) > 1 else ""


def check_enabled(config: RigConfig, where: str) -> None:
    """Raise RigError when faults are disabled, as they are by default."""
    if config.faults is None:
        raise RigError(f"{where}: faults are disabled; {HOW}")


def read_fault(config: RigConfig, given: str | Mapping, where: str) -> FaultOrder:
    """Return an order of a fault.

    Parameters
    ----------
    config : RigConfig
        The rig.
    given : str or mapping
        ``NAME, size=.., onset=.., over=.., period=.., share=.., at=.., when=SIGNAL above .., for=..`` or the same as a map with the
        key ``name``; ``off=true`` ends what was ordered.
    where : str
        Beginning of the errors.

    Returns
    -------
    FaultOrder
        The order.

    Raises
    ------
    RigError
        When the rig refuses it.
    """
    node = _split(given, where) if isinstance(given, str) else {str(key): value for key, value in given.items()}
    for key in node:
        if key not in KEYS:
            raise RigError(f"{where}: {unknown('key of a fault', key, KEYS)}")
    known, name = faults_of(config), str(node.get("name", ""))
    if name not in known:
        raise RigError(f"{where}: {unknown('fault', name, known)}")
    of = known[name]
    if of.lacking:
        raise RigError(f"{where}: fault {name} refused: {of.lacking}")
    text = ", ".join(
        [
            name,
            *(f"{key}={str(value).lower() if isinstance(value, bool) else value}" for key, value in node.items() if key != "name"),
        ]
    )
    if "off" in node:
        if len(node) > 2 or str(node["off"]).lower() != "true":
            raise RigError(f"{where}: fault {name}: off takes true, and no other key beside it")
        return FaultOrder(text, of, 0.0, ONSETS[0], OVER, PERIOD, SHARE, 0.0, None, float("inf"), True)
    onset = str(node.get("onset", of.fault.onset))
    if onset not in ONSETS:
        raise RigError(f"{where}: fault {name}: onset is {brief(onset)}, expected {', '.join(ONSETS)}")
    size = of.fault.size
    if size is None and ("size" in node or onset == GROWING):
        raise RigError(f"{where}: fault {name} has no size{', so it cannot grow' if onset == GROWING else ''}; it is there or not")
    for keys, kind in ((("over",), GROWING), (("period", "share"), INTERMITTENT)):
        if onset != kind and any(key in node for key in keys):
            raise RigError(f"{where}: fault {name}: {' and '.join(keys)} go with onset={kind}")

    def number(key: str, dimension: str, low: float, high: float, usual: float) -> float:
        if key not in node:
            return usual
        value = quantity(node[key], dimension, f"{where}: fault {name}: {key}")
        rounding = 1e-9 * abs(value)  # of the unit in which it is written
        if not low - rounding <= value <= high + rounding:
            raise RigError(f"{where}: fault {name}: {key} is {node[key]}, expected {span(low, high, node[key])}")
        return min(max(value, low), high)

    period = number("period", "time", LEAST_PERIOD, LONGEST_TIME, PERIOD)
    return FaultOrder(
        text,
        of,
        1.0 if size is None else number("size", size.quantity, size.low, size.high, size.usual),
        onset,
        number("over", "time", 0.0, LONGEST_TIME, OVER),
        period,
        number("share", "ratio", SAMPLE / period, 1.0, SHARE),  # a sample at least
        number("at", "time", 0.0, LONGEST_TIME, 0.0),
        _trigger(config, str(node["when"]), f"{where}: fault {name}: when") if "when" in node else None,
        number("for", "time", SAMPLE, LONGEST_TIME, float("inf")),
        False,
    )


def _split(text: str, where: str) -> dict[str, str]:
    name, *rest = (part.strip() for part in text.split(","))
    node = {"name": name}
    for part in rest:
        key, sign, value = (piece.strip() for piece in part.partition("="))
        if not sign or not value or key in node:
            raise RigError(f"{where}: {brief(part)} in the fault {brief(name)}; expected KEY=VALUE, each key once, e.g. at=5 s")
        node[key] = value
    return node


def _trigger(config: RigConfig, text: str, where: str) -> Trigger:
    words = text.split(maxsplit=2)
    if len(words) != 3 or words[1] not in (ABOVE, BELOW):
        raise RigError(f"{where} is {brief(text)}; expected SIGNAL above VALUE or SIGNAL below VALUE")
    signals = config.catalogue.signals
    if words[0] not in signals:
        raise RigError(f"{where}: {unknown('signal', words[0], signals)}")
    signal = signals[words[0]]
    value = quantity(words[2], DIMENSIONS.get(signal.quantity, signal.quantity), where)
    return Trigger(words[0], *((value, float("inf")) if words[1] == ABOVE else (float("-inf"), value)))


def orders_of(config: RigConfig, text: str, where: str) -> tuple[str, ...]:
    """Return the orders of the value of the key FAULTS as texts, each checked; RigError for one that the rig refuses."""
    if text.strip() == ENABLED:
        return ()
    return tuple(read_fault(config, one.strip(), where).text for one in text.split(FAULTS_APART))


def orders_by_name(names: list[str], rig: str, seed: int, settings: Mapping[str, str]) -> str:
    """Return the value of the key FAULTS for what people name.

    Parameters
    ----------
    names : list of str
        Orders, names or files of sets, and RANDOM.
    rig : str
        The rig.
    seed : int
        Seed by which a fault is drawn for RANDOM.
    settings : mapping of str to str
        The rig's other changed values.

    Returns
    -------
    str
        The value.

    Raises
    ------
    RigError
        When there is no such set, or no other fault can be drawn.
    """
    from .configuration import load_rig  # here, because a configuration reads orders

    orders: list[str] = []
    for name in (name for name in names if name != RANDOM):
        first = name.partition(",")[0].strip()
        orders += [name] if "." in first and not first.endswith((".yaml", ".yml")) else fault_set(find_of_rigs(FAULTS, name, rig))
    if RANDOM in names:
        config = load_rig(rig, dict(settings))
        for number in range(names.count(RANDOM)):
            orders.append(random_fault(config, seed, number, orders))
    return f" {FAULTS_APART} ".join(orders) or ENABLED


def random_fault(config: RigConfig, seed: int, number: int, others: list[str]) -> str:
    """Return an order drawn by a seed: a fault that no other order has, of its usual size times 0.5 to 1.5, after 2 to 10 s."""
    taken = {other.partition(",")[0].strip() for other in others}
    known = [
        one
        for one in faults_of(config).values()
        if not one.lacking
        and one.fault.part not in (*LINES, CONTROLLER)  # which of them a rig can have depends on its controller
        and one.name not in taken
        and not (one.fault.pairs and f"{one.configs[1]}.{one.fault.name}" in taken)
    ]
    if not known:
        raise RigError(f"{RANDOM}: '{config.name}' has no fault that could be drawn beside the {len(taken)} others")
    which, how, when = (uniform(seed, DRAWS + 3 * number + k, 0) for k in range(3))
    of = known[int(which * len(known))]
    text, size = f"{of.name}, at={2.0 + 8.0 * when:.3f} s", of.fault.size
    if size is None:
        return text
    unit, factor = shown_unit(size.quantity)
    return f"{text}, size={number_text(min(max(size.usual * (0.5 + how), size.low), size.high) / factor)} {unit}"


def fault_set(path: Path) -> list[str]:
    """Return the orders in a file of faults.

    Parameters
    ----------
    path : Path
        A file with the keys ``description`` and ``faults``, a list of maps as in a sequence's step ``fault``.

    Returns
    -------
    list of str
        Their texts.

    Raises
    ------
    RigError
        With file and line, when the file is no such set.
    """
    node = load_yaml(path)
    check_keys(path, node, ("description", FAULTS), ("description", FAULTS), "the set of faults")
    if not isinstance(node[FAULTS], list) or not node[FAULTS]:
        raise RigError(
            f"{where_of(path, node, FAULTS)}: faults must be a list with at least one fault, e.g. - name: oil_supply.air"
        )
    out = []
    for k, one in enumerate(node[FAULTS]):
        check_keys(path, one, KEYS, ("name",), "a fault", where_of(path, node[FAULTS], k))
        out.append(", ".join([str(one["name"]), *(f"{key}={value}" for key, value in one.items() if key != "name")]))
    return out
