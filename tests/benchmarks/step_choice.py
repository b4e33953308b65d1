# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Differences of a shift's metrics from those with a much finer step, for some steps of the plant: the table of
docs/background/physics.md.

.venv/bin/python tests/benchmarks/step_choice.py [--steps "100 us" "50 us"] [--reference "1 us"] [--json FILE]
"""

import argparse
import dataclasses
import json
import sys
from pathlib import Path

import numpy as np

from rig_nodes.analysis.shift import shifts
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.recorded import record
from rig_nodes.runs.sequence import load_sequence

METRICS = (
    "t_dt_s",
    "t_p_s",
    "t_c_s",
    "t_o_s",
    "overlap_s",
    "input_torque_max_nm",
    "output_speed_min_rpm",
    "k",
    "e_loss_j",
    "e_loss_settled_j",
)
# speed, torque before the shift up, torque before the shift down: points of the grid of tab. 7.4
POINTS = (("1500 rpm", "80 Nm", "80 Nm"), ("1500 rpm", "40 Nm", "160 Nm"), ("800 rpm", "60 Nm", "120 Nm"))
FINER = 100  # rows interpolated between two logger rows, because the metrics count in whole rows


def finer(recording):
    """Returns the same recording with more rows."""
    rows = np.arange(recording.rows)
    dense = np.arange(FINER * (recording.rows - 1) + 1) / FINER
    channels = {name: np.interp(dense, rows, values) for name, values in recording.channels.items()}
    return dataclasses.replace(recording, period=recording.period / FINER, channels=channels)


def metrics_at(step: str) -> dict[str, dict[str, float]]:
    """Returns "speed, loads, direction" -> metric -> value, without transducers."""
    out = {}
    for point in POINTS:
        config = load_rig("hydmag", {"kernel.step": step, "effects.transducers": "off"})
        sequence = load_sequence("grid_point", dict(zip(("speed", "load_up", "load_down"), point)))
        run = record(config, sequence)
        for row in shifts(finer(run.recording)):
            up = row["to_gear"] == 2
            name = f"{point[0]}, {point[1] if up else point[2]}, {'I to II' if up else 'II to I'}"
            if row["valid"] and not (row["from_gear"] == 0 or row["to_gear"] == 0):
                out[name] = {metric: row[metric] for metric in METRICS}
    return out


def main() -> int:
    """Prints the table: for each step and metric the largest change against the reference, and its place."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", nargs="+", default=["100 us", "50 us", "20 us", "10 us"])
    parser.add_argument("--reference", default="1 us")
    parser.add_argument("--json", type=Path, help="keep and use what was computed before, per step")
    args = parser.parse_args()
    known = json.loads(args.json.read_text()) if args.json and args.json.exists() else {}
    for step in (*args.steps, args.reference):
        if step not in known:
            known[step] = metrics_at(step)
            if args.json:
                args.json.write_text(json.dumps(known, indent=1))
    print("| step | " + " | ".join(METRICS) + " | shifts beyond 0.1 % |")
    print("| --- " * (len(METRICS) + 2) + "|")
    reference = known[args.reference]
    for step in args.steps:
        worst, beyond = [], []
        for metric in METRICS:
            errors = {
                name: 100.0 * (known[step][name][metric] / values[metric] - 1.0)
                for name, values in reference.items()
                if values[metric]
            }
            name = max(errors, key=lambda shift: abs(errors[shift]))
            worst.append(f"{errors[name]:+.3f} %")
            beyond += [f"{shift}: {metric}" for shift, error in errors.items() if abs(error) > 0.1]
        print(f"| {step} | " + " | ".join(worst) + f" | {'; '.join(beyond) or 'none'} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
