# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The reference page of parameters: each value of each part and section with its unit, range and meaning.

`rig list` and docs/made_pages.py use it. It is made from the fields themselves, so nothing is typed twice; it has no values of a
particular rig.
"""

from __future__ import annotations

from dataclasses import MISSING, fields
from importlib import import_module

from ..base import UNITS, shown_in
from ..plant import part as parts
from .alfa46 import Alfa46Values
from .read import meaning
from .sections import (
    OF_THE_LOGGER,
    BodyConfig,
    BrakeConfig,
    ClutchConfig,
    CutConfig,
    EffectsConfig,
    KernelConfig,
    MeshConfig,
    ShaftConfig,
    SliderCrankConfig,
    StateConfig,
    VariatorConfig,
)
from .transducer_types import TRANSDUCER_TYPES


def sections() -> dict[str, tuple[str, dict]]:
    """Return the sections of a rig's file that belong to no part: the line about each, and its fields by name."""
    return {
        "the rig itself": ("Beside `description` and the other keys.", _of(KernelConfig)),
        "bodies": ("Of each body that is not `massless`.", _of(BodyConfig)),
        "shafts": ("Of each compliant shaft.", _of(ShaftConfig)),
        "meshes": ("Of toothed wheels with a name and an efficiency, and of planetary sets with an efficiency.", _of(MeshConfig)),
        "clutches": ("Of each clutch that is no device.", _of(ClutchConfig)),
        "brakes": ("Of each brake that is no device.", _of(BrakeConfig)),
        "slider_cranks": ("Of each slider with its crank.", _of(SliderCrankConfig)),
        "variators": ("Of each gear whose ratio varies.", _of(VariatorConfig)),
        "states": ("Of each temperature that takes in what elements lose.", _of(StateConfig)),
        **{
            f"instruments, {name}": (
                f"Of each transducer of `type: {name}`; the names begin with the type, or with what stands under "
                f"`like`: `{name}_range`.",
                one.errors(),
            )
            for name, one in TRANSDUCER_TYPES.items()
        },
        "instruments, all": ("Of the logger.", {name: one() for name, one in OF_THE_LOGGER.items()}),
        "effects": ("Only those that the rig's parts have may be named, and `transducers`.", _of(EffectsConfig)),
        "cut": ("Of devices outside the plant ([cuts.md](../how_to/cuts.md)).", _of(CutConfig)),
        "controller": (
            "The Alfa46's, in the file that `controller` names, or under `controller_values`; its profiles stand beside them.",
            _of(Alfa46Values),
        ),
    }


def rows_of_parts() -> list[dict[str, str]]:
    """Return one row for each value of each part."""
    return [{"part": name, **row} for name in parts.parts() for row in _rows(_fields(parts.part(name)))]


def page() -> str:
    """Return the text of docs/made/parameters.md."""
    out = [
        "# Parameters of parts and sections",
        "",
        "[Rigs](../how_to/rigs.md) describes their place in a rig's folder; the values of one rig are printed by "
        "`./rig list settings --rig NAME`.",
        "",
        'Each value is `[value with unit, "its source"]`. The range is inclusive and given in the unit shown; the '
        "units at the end may "
        'be written too. What has a value under "left out", or a dash, need not be named; "while it runs": it can '
        "change then too ([settings.md](../how_to/settings.md)).",
        "",
        "## Parts",
        "",
    ]
    for name in parts.parts():
        out += [f"### {name}", "", _about(name), "", *_joints(parts.part(name)), *_table(_rows(_fields(parts.part(name))))]
    out += ["## Other sections", ""]
    for name, (about, those) in sections().items():
        out += [f"### {name}", "", about, "", *_table(_rows(those))]
    units: dict[str, list[str]] = {}
    for unit, (dimension, _) in UNITS.items():
        units.setdefault(dimension, []).append(f"`{unit}`")
    return "\n".join(
        [*out, "## Units", "", *_table([{"dimension": dimension, "units": ", ".join(those)} for dimension, those in units.items()])]
    )


def _about(name: str) -> str:
    """The first line of a part's file."""
    return import_module(f"{parts.__package__}.{name}").__doc__.strip().splitlines()[0]


def _joints(part: parts.Part) -> list[str]:
    """Lines on what a part is joined to, which setpoints it takes and which signals it shows."""
    joined = [f"`{key}` ({meaning(wire.to)}{'' if wire.needed else '; may be left out'})" for key, wire in part.joined.items()]
    takes = [f"`{one.step}: {{{key}: ...}}`" for one in part.takes for key in one.takes]
    lines = [
        f"{what}: {', '.join(those)}."
        for what, those in (("Joined by", joined), ("Takes", takes), ("Signals", [one.what for one in part.shows]))
        if those
    ]
    return [line for text in lines for line in (text, "")]


def _of(cls: type) -> dict:
    """Fields of a dataclass by name."""
    return {one.name: one for one in fields(cls)}


def _fields(part: parts.Part) -> dict:
    """The values that the entry of a part in a rig has."""
    return _of(part.configs[0]) if part.configs else {}


def _rows(those: dict) -> list[dict[str, str]]:
    out = []
    for name, one in those.items():
        meta = one.metadata
        if "choices" in meta:
            unit, span = "", ", ".join(meta["choices"])
        else:
            unit, factor = shown_in(meta["dimension"])
            span = f"{meta['low'] / factor:.6g} to {meta['high'] / factor:.6g}"
        left = (
            ""
            if one.default is MISSING
            else "-"
            if one.default is None
            else ("on" if one.default is True else f"{one.default:.6g} {unit}".rstrip(" -"))
        )
        out.append(
            {
                "value": name,
                "unit": unit,
                "range": span,
                "left out": left,
                "while it runs": "yes" if meta.get("live") else "",
                "what it is": meta["text"],
            }
        )
    return out


def _table(rows: list[dict[str, str]]) -> list[str]:
    if not rows:
        return ["It has no values of its own.", ""]
    own = [key for key in rows[0] if key not in ("left out", "while it runs") or any(row[key] for row in rows)]
    return [
        "| " + " | ".join(own) + " |",
        "|" + " --- |" * len(own),
        *("| " + " | ".join(row[key].replace("|", "\\|") for key in own) + " |" for row in rows),
        "",
    ]
