# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The folder of a tuning: journal, fronts as Parquet, JSON and pictures, and controllers as YAML.

Used by the verb ``tune`` through studies.tune.run.
"""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

from ...base import UNITS
from ...rig import OUTPUT_KEYS, POINTS, Alfa46Config, Alfa46Values
from ..sweep.store import parquet, write_table
from .problem import OBJECTIVES
from .space import BOUNDS, check

TUNING, TUNING_JOURNAL, FRONT = "tune.json", "generations.jsonl", "front"
COUNTS = ("rigs", "better_rigs", "pairs", "better", "failed", "missed", "left_out")  # counts of a judgement, as in judge.Verdict
# the units in which the laboratory gave the settings
SETTING_UNITS = {
    "sample_time": "ms",
    "pwm_frequency": "kHz",
    "supply_voltage": "V",
    "gain_p": "V/A",
    "gain_i": "V/(A s)",
    "gain_d": "V s/A",
    "derivative_time": "ms",
    "current_limit": "mA",
    "t12": "ms",
    "t21": "ms",
    "t23": "ms",
    "t32": "ms",
}


def controller_yaml(settings: Alfa46Config, title: str, source: str = "rig tune") -> str:
    """Return settings as the text of a file for ``controller:`` of a rig, in whole ms and mA.

    Parameters
    ----------
    settings : Alfa46Config
        The settings.
    title : str
        First comment of the file.
    source : str
        Source of the delays between the outputs.

    Returns
    -------
    str
        The YAML text.

    Raises
    ------
    RigError
        When the box would refuse the settings.
    """
    check(settings)
    lines = [f"# {title}", '# Values are [value with unit, "its source"]; profiles are [time, current] for P1 to P6.', ""]
    for field in fields(Alfa46Values):
        unit = SETTING_UNITS[field.name]
        of = source if field.name in ("t12", "t21", "t23", "t32") else "as in the settings it began from"
        value = getattr(settings.values, field.name) / UNITS[unit][1]
        lines.append(f'{field.name}: [{value:.10g} {unit}, "{of}"]')
    lines += ["", "# P1-P3 count from switch-on, P4-P6 from switch-off", "profiles:"]
    for key, profile in zip(OUTPUT_KEYS, settings.profiles):
        lines.append(f"  {key}:")
        lines += [
            f"    {name}: [{round(time * 1e3)} ms, {round(current * 1e3)} mA]" for name, (time, current) in zip(POINTS, profile)
        ]
    return "\n".join([*lines, ""])


def rig_yaml(base: str, controller: str, title: str) -> str:
    """Return the YAML text of a rig: its base, a controller's file beside it, and a title as its description."""
    return f"description: {json.dumps(title, ensure_ascii=False)}\nbase: {base}\ncontroller: {controller}\n"


def write_front(folder: Path, rows: list[dict], manifest: dict) -> None:
    """Write front.parquet: one row for each setting of the fronts, with units in the schema.

    Parameters
    ----------
    folder : Path
        Folder of the tuning.
    rows : list of dict
        One row for each setting, with a value for each column.
    manifest : dict
        What decides the tuning; it is stored in the schema.
    """
    pa, _ = parquet()
    objectives = manifest["objectives"]
    columns = [
        pa.field("way", pa.string()),
        pa.field(
            "dominates",
            pa.bool_(),
            metadata={"about": "better than the compared settings in every shift of the judgement, which the search did not see"},
        ),
    ]
    columns += [pa.field(name, pa.int64()) for name in COUNTS]
    for name in objectives:
        about = OBJECTIVES[name][0] + ("" if name == "dip" else ", as a share of the compared settings'")
        columns += [
            pa.field(f"{name}{suffix}", pa.float64(), metadata={"about": f"{about}; {what}", "unit": "-"})
            for suffix, what in (
                ("", "as it was sought"),
                ("_mean", "mean of the judgement's shifts"),
                ("_worst", "worst of the judgement's shifts"),
            )
        ]
    for name in BOUNDS:
        columns.append(pa.field(name, pa.int64(), metadata={"unit": "mA" if name.endswith("current") else "ms"}))
    schema = pa.schema(columns, metadata={"rig_nodes.tune": json.dumps(manifest, ensure_ascii=False)})
    write_table(folder / f"{FRONT}.parquet", {name: [row[name] for row in rows] for name in schema.names}, schema)
