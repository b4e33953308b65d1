# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The configuration of a rig from the record in a bag, so that a run needs no file of its rig to be run again.

runs.rerun uses it. It is the inverse of RigConfig.as_dict.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base import SAMPLE, RigError
from ..plant import Force
from ..plant import part as parts
from .alfa46 import OUTPUT_KEYS, Alfa46Config, Alfa46Values
from .configuration import NoValues, RigConfig
from .faults import FAULTS
from .prescribed import OUTPUT_SPEEDS, Prescribed
from .sections import CutConfig, EffectsConfig, KernelConfig, instruments_of, section_classes, with_written
from .structure import structure_of
from .trips import OWN_TRIPS, TRIP_SOURCES, TRIPS, WATCHED, OwnTrip


def config_of_record(record: Mapping, where: str) -> RigConfig:
    """Return the configuration that a record describes.

    Parameters
    ----------
    record : mapping
        Result of RigConfig.as_dict, as a bag holds it (Bag.record).
    where : str
        The bag, for the error.

    Returns
    -------
    RigConfig
        The configuration; its own record is the given one, with the defaults of settings that came since.

    Raises
    ------
    RigError
        When the record does not describe a rig of this version.
    """
    try:
        config = _config(record)
    except (RigError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise _other_version(where, f"{type(error).__name__}: {error}") from None
    ours = json.loads(json.dumps(config.as_dict()))
    given = json.loads(json.dumps(dict(record)))
    different = [key for key in sorted({*ours, *given}) if _known_to(given.get(key), ours.get(key)) != given.get(key)]
    if different:
        raise _other_version(where, f"{', '.join(different)} would be other than recorded")
    return config


def _known_to(given: Any, ours: Any) -> Any:
    """Return our values of a section without those that a record of an earlier version does not have."""
    if isinstance(ours, dict) and isinstance(given, dict):
        return {name: value for name, value in ours.items() if name in given}
    return ours


def _other_version(where: str, why: str) -> RigError:
    return RigError(f"{where}: the recorded configuration is not one of this version ({why}); give the rig by --rig")


def _config(record: Mapping) -> RigConfig:
    structure = structure_of(record["structure"])
    sections: dict[str, object] = {}
    for name, cls in section_classes(structure).items():
        sections[name] = with_written(cls, tuple(record[name]))(**record[name])
    for device in structure.devices:
        part = parts.part(device.part)
        cls = part.configs[0] if part.configs else NoValues
        sections[device.name] = cls(**_tuples(record[device.name]))
    sections["instruments"] = instruments_of(structure)(**record["instruments"])
    sections["effects"] = EffectsConfig(**record["effects"])
    cut = dict(record.get("cut") or {"tick": SAMPLE})
    cut_out = tuple(cut.pop("devices", ()))
    trips = dict(record.get(TRIPS) or {})
    watched = bool(trips.pop(WATCHED, True))
    return RigConfig(
        record["name"],
        structure,
        KernelConfig(**record["kernel"]),
        sections,
        tuple(record.get("wiring", ())) or tuple(valve.wires["output"] - 1 for valve in structure.valves),
        _controller(record.get("alfa46")),
        CutConfig(**cut),
        cut_out,
        _prescribed(record.get("prescribed")),
        tuple(record[FAULTS]) if FAULTS in record else None,
        trip_values=trips,
        trips_watched=watched,
        trip_sources=dict(record.get(TRIP_SOURCES) or {}),
        own_trips=tuple(OwnTrip(**one) for one in record.get(OWN_TRIPS) or ()),
    )


def _tuples(value: Any) -> Any:
    """Return a value read from JSON with its lists as the tuples that the values of parts are."""
    if isinstance(value, Mapping):
        return {name: _tuples(one) for name, one in value.items()}
    return tuple(map(_tuples, value)) if isinstance(value, (list, tuple)) else value


def _controller(record: Mapping | None) -> Alfa46Config | None:
    if record is None:
        return None
    profiles = np.array([record["profiles"][key] for key in OUTPUT_KEYS], order="C")
    return Alfa46Config(Alfa46Values(**{name: value for name, value in record.items() if name != "profiles"}), profiles)


def _prescribed(record: Mapping | None) -> Prescribed | None:
    if record is None:
        return None
    pieces = [[[[np.inf if x is None else x for x in row] for row in way] for way in clutch] for clutch in record["pieces"]]
    forces = tuple(Force(**force) for force in record["forces"])
    return Prescribed(forces, np.array(pieces), record["output_speed"] == OUTPUT_SPEEDS[0])
