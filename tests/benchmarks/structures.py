# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Structures of the plates' friction, each calibrated on some figures and judged on another: the table of
docs/background/physics.md.

.venv/bin/python tests/benchmarks/structures.py [NUMBER ...] [--samples N] [--json FILE]    # numbers: rows of the table, from 1

Each structure is the rig with some settings fixed and the others drawn at random within their bounds in calibration.yaml, with the
same number of draws for each. For each fold, the draw with the least cost on the rows of the other folds is judged on the rows of
this fold.
"""

import argparse
import json
import sys
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import qmc

from rig_nodes.base.errors import RigError
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rigs.hydmag.laboratory.calibration_rows import RPM, calibration, shift
from rig_nodes.runs.trips import Tripped
from rig_nodes.studies.validation.calibrate import at_shares, total

UNSHIFTED = 10.0  # tolerances for a shift that does not end
JUMP = {"plate_pack.film_time": "0 s", "plate_pack.friction_speed": "0.001 mm/s"}
ANNEX_D = {
    "loss_in.constant": "-3.2251 Nm",
    "loss_in.share": "20.22 %",
    "loss_in.square": "-0.0004 1/Nm",
    "loss_out.share": "-0.4 %",
    "loss_out.square": "0.0018 1/Nm",
    "motor.power_limit": "78.5 kW",
}


@dataclass(frozen=True)
class Structure:
    """Fixed settings, and the parameters of the stage ``release`` that are searched."""

    free: tuple[str, ...]
    held: dict[str, str] = field(default_factory=dict)


STRUCTURES = {
    "two frictions, a jump between them": Structure(("rest", "kinetic"), JUMP),
    "Stribeck's curve without a film time": Structure(("rest", "kinetic", "stribeck"), {"plate_pack.film_time": "0 s"}),
    "film time without Stribeck's curve": Structure(
        ("rest", "kinetic", "film_time"), {"plate_pack.friction_speed": JUMP["plate_pack.friction_speed"]}
    ),
    "both, no M_rest": Structure(("kinetic", "film_time", "stribeck"), {"plate_pack.rest_torque": "0 Nm"}),
    "both (the rig)": Structure(("rest", "kinetic", "film_time", "stribeck")),
    "both, losses of Annex D": Structure(("rest", "kinetic", "film_time", "stribeck"), ANNEX_D),
}


def outside(value, low=-np.inf, high=np.inf, tolerance=0.01):
    """Returns the distance of a value to its range [tolerances]; UNSHIFTED for a shift that has no value."""
    return UNSHIFTED if value is None else (min(0.0, value - low) + max(0.0, value - high)) / tolerance


def falls(rows, key, most, tolerance):
    """Returns the excess of the last value over the first one and over ``most`` times the first one [tolerances]."""
    if rows[0][key] is None or rows[-1][key] is None:
        return UNSHIFTED
    return max(0.0, rows[-1][key] - most * rows[0][key]) / tolerance


def folds_of(config):
    """Returns fold -> misses [tolerances] of the printed results of its figures."""
    up = {(n, m): shift(config, 2, None, n * RPM, m) for n, m in ((1000, 40), (1500, 40), (1500, 120), (2000, 120))}
    down = [shift(config, 1, None, 1500 * RPM, m) for m in (40.0, 160.0, 240.0)]
    late, early, middle = (shift(config, 2, t12) for t12 in (-0.15, -0.19, -0.1))
    best = shift(config, 1, set_in=1)
    loaded = [up[1500, 120], up[2000, 120]]
    return {
        # fig. 7.31 to 7.43
        "7.4.1, I to II": [
            *(outside(one["input_torque_max_nm"], 244.0, 293.0, 6.5) for one in up.values()),
            *(outside(one["t_dt_s"], 0.26, 0.40) for one in up.values()),
            *(outside(one["t_p_s"], 0.1) for one in loaded),
            *(outside(one["t_o_s"], high=0.02) for one in loaded),
            outside(up[1500, 40]["t_o_s"], high=0.18),
            outside(up[1500, 120]["k"], 0.95, tolerance=0.05),
        ],
        # fig. 7.44 to 7.50
        "7.4.2, II to I": [
            *(outside(one["t_dt_s"], high=0.26) for one in down),
            *(outside(one["t_p_s"], 0.04, 0.11) for one in down),
            *(outside(one["t_o_s"], 0.1) for one in down),
            outside(down[-1]["input_torque_max_nm"], 340.0, 400.0, 60.0),
            falls(down, "e_loss_j", 1.0, 30.0),
        ],
        # fig. 7.17 to 7.29
        "7.3.3, delays": [
            outside(late["k"], high=0.95, tolerance=0.05),
            outside(early["k"], 0.95, tolerance=0.05),
            outside(middle["input_torque_max_nm"], high=300.0, tolerance=6.5),
            outside(best["input_torque_max_nm"], 121.3, 125.3, 2.0),
        ],
    }


def draws(structure, samples, progress):
    """Returns (misses by fold, values) of each draw whose shifts can be run."""
    parameters = {name: p for name, p in calibration().stages["clutches"].items() if name in structure.free}
    config, found = load_rig("hydmag", structure.held), []
    for k, shares in enumerate(qmc.LatinHypercube(len(parameters), seed=1).random(samples)):
        progress(k)
        one, values = at_shares(config, parameters, shares)
        try:
            found.append((folds_of(one), values))
        except (Tripped, RigError):
            continue
    return found


def judge(found):
    """Returns fold -> (cost on the other folds, cost on this one, its rows outside, its rows, values) of the chosen draw."""
    out = {}
    for fold in found[0][0]:
        costs = [sum(total(np.array(misses)) for name, misses in folds.items() if name != fold) for folds, _ in found]
        best = int(np.argmin(costs))
        misses = np.array(found[best][0][fold])
        out[fold] = costs[best], total(misses), int(np.sum(np.abs(misses) > 0.0)), len(misses), found[best][1]
    return out


def main():
    """Prints the table; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("numbers", type=int, nargs="*", metavar="NUMBER")
    parser.add_argument("--samples", type=int, default=40)
    parser.add_argument("--json")
    args = parser.parse_args()
    # argparse refuses its own empty list where choices are given
    if any(not 1 <= number <= len(STRUCTURES) for number in args.numbers):
        parser.error(f"NUMBER: {args.numbers} are not all rows of the table, 1 to {len(STRUCTURES)}")
    table = {}
    for number, (name, structure) in enumerate(STRUCTURES.items(), 1):
        if args.numbers and number not in args.numbers:
            continue

        def progress(k, name=name):
            print(f"\r{name}: {k} of {args.samples}", end="", file=sys.stderr, flush=True)

        table[name] = judge(draws(structure, args.samples, progress))
        rows = table[name].values()
        apart = ", ".join(f"{missed} of {count}" for _, _, missed, count, _ in rows)
        print(f"\r| {name} | {len(structure.free)} | {apart} | {sum(row[1] for row in rows):.2f} |", flush=True)
    if args.json:
        with open(args.json, "w") as file:
            json.dump(table, file, indent=1)
    return 0


if __name__ == "__main__":
    sys.exit(main())
