# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Effect of the transducers and the logger on the metrics of a shift: the table of docs/background/physics.md.

.venv/bin/python tests/benchmarks/instruments.py [--seeds N]

Each run has the same seed and the same orders at the same moments with these parts and without them; the noise of the coils'
currents, which acts on the plant through the current loop, is in all of them.
"""

import argparse
import dataclasses
import sys

from rig_nodes.analysis.measured_error import instruments_of, uncertainty
from rig_nodes.analysis.shift import shifts
from rig_nodes.base.units import UNITS
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.recorded import record
from rig_nodes.runs.sequence import load_sequence

HYDMAG = load_rig("hydmag")

SETTLED = 6.0  # time that replaces a wait for a measured value [s]; longer than any such wait
SPEEDS = {"500 rpm": "delay", "1500 rpm": "grid_point"}
# metric of a row, its name in (6.85) and the like for I to II and II to I, factor to the printed unit, unit, digits
METRICS = (
    ("t_dt_s", "t_dtm", "t_dtr", 1e3, " ms", 1),
    ("t_p_s", "t_p12", "t_p21", 1e3, " ms", 1),
    ("t_c_s", "t_c12", "t_c21", 1e3, " ms", 1),
    ("t_o_s", "t_o12", "t_o21", 1e3, " ms", 1),
    ("input_torque_max_nm", "peak M_wej", "peak M_wej", 1.0, " Nm", 1),
    ("k", "k_z", "k_r", 1.0, "", 3),
    ("e_loss_j", "E_loss", "E_loss", 1.0, " J", 0),
    ("overlap_s", "overlap", "overlap", 1e3, " ms", 0),
)


def settings(kept: tuple[str, ...] = ()) -> dict[str, str]:
    """Returns overrides that leave out each part of the instruments but those of the currents and those that end like ``kept``."""
    known = load_rig("hydmag").settings
    parts = ("_class", "_hum", "_pickup", "_noise", "_step", "_gate", "_bits", "_alias", "_offset", "_gain")
    names = [name for name in known if name.startswith("instruments.") and not name.startswith("instruments.current")]
    left_out = [name for name in names if name.endswith(tuple(set(parts) - set(kept)))]
    si = {dimension: unit for unit, (dimension, factor) in UNITS.items() if factor == 1.0}
    # the least value of each field, because a gate of 0 is not allowed
    return {name: f"{max(0.0, known[name].low):g} {si[known[name].dimension]}" for name in left_out}


def first_shifts(name: str, speed: str, seed: int, values: dict[str, str]) -> list[tuple[dict, dict]]:
    """Returns the rows of the first shift up and the first down under load, each with its largest errors by (7.1)."""
    sequence = load_sequence(name, {"speed": speed}, default="hydmag")
    steps = [
        step if step.condition is None else dataclasses.replace(step, condition=None, value=SETTLED) for step in sequence.steps
    ]
    run = record(load_rig("hydmag", values), dataclasses.replace(sequence, steps=steps), seed=seed).recording
    return [
        (row, uncertainty(row, instruments_of(HYDMAG.as_dict()), HYDMAG.transmission, period=run.period)) for row in shifts(run)[:2]
    ]


def main() -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--seeds", type=int, default=5, help="runs of each kind [5]")
    args = parser.parse_args()
    kinds = {"none": settings(), "noise": settings(("_noise", "_bits")), "all": {}}
    found = {
        speed: {
            kind: [first_shifts(name, speed, seed, values) for seed in range(1, args.seeds + 1)] for kind, values in kinds.items()
        }
        for speed, name in SPEEDS.items()
    }
    heads = [f"{head}, {speed}" if head != "bound" else head for speed in SPEEDS for head in ("noise", "all", "bound")]
    print(f"| metric | {' | '.join(heads)} |\n{'| --- ' * (1 + len(heads))}|")
    for direction, way in enumerate(("I to II", "II to I")):
        for key, *names, factor, unit, digits in METRICS:
            cells = [f"{f'{way}: ' if key == METRICS[0][0] else ''}{names[direction]}{unit}"]
            for runs in found.values():
                for kind in ("noise", "all"):
                    off = [
                        factor * (with_it[direction][0][key] - without[direction][0][key])
                        for with_it, without in zip(runs[kind], runs["none"], strict=True)
                    ]
                    cells.append(" to ".join(f"{round(one(off), digits) + 0.0:.{digits}f}" for one in (min, max)))  # 0.0: no -0
                cells.append(f"{factor * max(run[direction][1][key] for run in runs['all']):.{digits}f}")
            print(f"| {' | '.join(cells)} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
