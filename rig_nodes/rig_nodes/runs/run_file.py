# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""run.json in the folder of a run: what was ordered, parsed once, for every process of the run and for people.

A file of the rig or of the sequence that is saved while the run starts changes nothing of it any more.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from math import inf
from pathlib import Path
from typing import NamedTuple

from ..base import RUN_FILE, RigError, atomic_write
from ..rig import RigConfig, config_of_record
from .sequence import Condition, Sequence, Step


class Ordered(NamedTuple):
    """What a run was ordered to be.

    ``rig`` is the name or file that the configuration was read from, beside which later sequences are looked for; ``sequence``
    is None for a rig that is operated by hand, ``controller`` None for the rig's own.
    """

    config: RigConfig
    rig: str
    sequence: Sequence | None = None
    seed: int = 1
    delay: int = 1
    controller: str | None = None


def write_run(folder: Path, ordered: Ordered) -> Path:
    """Write the file of a run into its folder and return its path; RigError when it cannot be written."""
    path = Path(folder) / RUN_FILE
    plain = {
        "rig": ordered.rig,
        "sequence": None if ordered.sequence is None else _plain(ordered.sequence),
        "seed": ordered.seed,
        "delay": ordered.delay,
        "controller": ordered.controller,
        "configuration": ordered.config.as_dict(),
    }
    atomic_write(path, json.dumps(plain, indent=1, allow_nan=False) + "\n")
    return path


def read_run(path: str | Path) -> Ordered:
    """Read what :func:`write_run` wrote; RigError when the file is not such a file of this version."""
    try:
        plain = json.loads(Path(path).read_text(encoding="utf-8"))
        record, sequence = plain.pop("configuration"), plain.pop("sequence")
        return Ordered(config_of_record(record, str(path)), sequence=None if sequence is None else _sequence(sequence), **plain)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise RigError(f"{path}: is no run file of this version ({type(error).__name__}: {error})") from None


def _plain(sequence: Sequence) -> dict:
    plain = asdict(sequence)
    for step in plain["steps"]:
        if step["condition"]:  # JSON has no infinity
            step["condition"] = {name: None if value in (-inf, inf) else value for name, value in step["condition"].items()}
    return plain


def _sequence(plain: dict) -> Sequence:
    steps = [Step(**{**step, "condition": _condition(step["condition"])}) for step in plain.pop("steps")]
    return Sequence(steps=steps, **plain)


def _condition(plain: dict | None) -> Condition | None:
    if plain is None:
        return None
    low, high = plain["low"], plain["high"]
    return Condition(plain["signal"], -inf if low is None else low, inf if high is None else high)
