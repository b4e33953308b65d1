# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the controller of fill_time.c learns: on a new, a worn and a cold gearbox, and on others drawn at random.

    .venv/bin/python docs/examples/fill_time/plants.py --drawn 20 --json fill_time.json

On each it begins three tenths below or above the fill time that this gearbox has.
"""

import argparse
import json
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

import rig_nodes

HERE = Path(__file__).parent
SEQUENCE, CONTROLLER = HERE / "shifts.yaml", f"c:{HERE / 'fill_time.c'}"
SHIFTS, WRONG, LIMIT = 6, 0.3, 10e-3  # of each way; share by which it begins wrong; error to be reached [s]
LONG = 0.9  # s, longer than any clutch fills: the controller then ends the fill at the knee, so the gearbox shows its own time
STATE = 5e-3  # s between two recorded states of the plant
CLEARANCES = {
    "clutch_s1.clearance": 0.4e-3,
    "clutch_s2.clearance": 0.6e-3,
}  # what a worn gearbox has more [m], as its faults/worn.yaml
# what is drawn, evenly between two shares of the rig's own value: assumed spreads of manufacture and wear
DRAWN = {
    "clutch_s1.clearance": (0.9, 1.3),
    "clutch_s2.clearance": (0.9, 1.15),
    "clutch_s2.drained_volume": (0.8, 1.2),
    "clutch_s1.seal_friction": (0.7, 1.5),
    "clutch_s2.seal_friction": (0.7, 1.5),
    "valve_zr_p1.supply_bore_area": (0.9, 1.1),
    "valve_zr_p2.supply_bore_area": (0.9, 1.1),
    "valve_zr_p1.cracking_current": (0.97, 1.03),
    "valve_zr_p2.cracking_current": (0.97, 1.03),
}
OIL, SPEED, LOAD = (20.0, 80.0), (700.0, 1300.0), (30.0, 90.0)  # degC, rpm, Nm; assumed


def gearboxes(count):
    """Return the three gearboxes and ``count`` drawn ones, as dicts; of any count the first ones are the same."""
    own = rig_nodes.load("hydmag").config.value
    worn = {name: own(name) + more for name, more in CLEARANCES.items()}
    found = [{"name": name, "settings": {}, "with": {}, "seed": 1, "wrong": -WRONG} for name in ("new", "worn", "cold")]
    found[1]["settings"], found[2]["settings"] = worn, {"oil_supply.temperature": "20 degC"}
    for seed in range(1, count + 1):
        draw = np.random.default_rng(seed).uniform
        settings = {name: own(name) * draw(*shares) for name, shares in DRAWN.items()}
        settings["oil_supply.temperature"] = f"{draw(*OIL):.0f} degC"
        given = {"speed": f"{draw(*SPEED):.0f} rpm", "load": f"{draw(*LOAD):.0f} Nm"}
        found.append({"name": f"{seed}", "settings": settings, "with": given, "seed": seed, "wrong": WRONG if seed % 2 else -WRONG})
    return found


def fills(gearbox, first, shifts):
    """Return, for each clutch, (fill time assumed, kiss point after the order) of each shift [s]; it begins with ``first``."""
    given = {**gearbox["with"], "shifts": shifts, **{f"begin_{k}": f"{first[k]:.4f}" for k in "12"}}
    rig = rig_nodes.load("hydmag", **gearbox["settings"])
    run = rig.simulate(SEQUENCE, seed=gearbox["seed"], controller=CONTROLLER, parameters=given)
    if run.end["state"] != "ended":
        raise SystemExit(f"gearbox {gearbox['name']}: {run.end['reason']}")
    found = {"1": [], "2": []}
    for order, gear in zip(run.shifts["t_order_s"], run.shifts["to_gear"]):
        k = {"I": "1", "II": "2"}[gear]
        clamp, learned = run.signals[f"s{k}_clamp"], run.signals[f"fill_{k}"]
        pressed = clamp.time[(clamp.time > order) & (clamp.values > 0.0)]
        assumed = learned.values[np.searchsorted(learned.time, order + STATE)]
        found[k].append((float(assumed), float(pressed[0] - 0.5 * STATE - order)))
    return found


def learned(gearbox):
    """Return a gearbox with its own fill times [s] and the errors of its shifts [ms]: kiss point less assumed fill time."""
    own = {k: pairs[-1][1] for k, pairs in fills(gearbox, {"1": LONG, "2": LONG}, 1).items()}
    found = fills(gearbox, {k: time * (1.0 + gearbox["wrong"]) for k, time in own.items()}, SHIFTS)
    errors = {k: [round(1e3 * (kiss - assumed), 1) for assumed, kiss in pairs] for k, pairs in found.items()}
    return {**gearbox, "own": {k: round(time, 4) for k, time in own.items()}, "errors": errors}


def shifts_needed(errors):
    """Return the number of the shift from which on the error stays below the limit, None when it does not."""
    late = [n for n, error in enumerate(errors, 1) if abs(error) >= 1e3 * LIMIT]
    number = late[-1] + 1 if late else 1
    return number if number <= len(errors) else None


def main():
    """Print a line for each gearbox; exit code 1 when one does not get there."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--drawn", type=int, default=20, help="gearboxes that are drawn at random (20)")
    parser.add_argument("--json", type=Path, help="file to write")
    given = parser.parse_args()
    rows, good = [], True
    with ProcessPoolExecutor() as pool:
        for one in pool.map(learned, gearboxes(given.drawn)):
            rows.append(one)
            for k, errors in one["errors"].items():
                number = shifts_needed(errors)
                good &= number is not None
                print(
                    f"{one['name']:>5} S{k}  fills {1e3 * one['own'][k]:4.0f} ms  first error {errors[0]:+6.1f} ms"
                    f"  last {errors[-1]:+5.1f} ms  below {1e3 * LIMIT:.0f} ms from shift {number}",
                    flush=True,
                )
    if given.json:
        given.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
