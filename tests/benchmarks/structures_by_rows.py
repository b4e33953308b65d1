# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Structures of driveline and hydraulics, each by the rows of the laboratory that it gains and loses: the table of
docs/background/physics.md.

.venv/bin/python tests/benchmarks/structures_by_rows.py [NUMBER ...] [--jobs N]    # numbers: rows of the table, from 1

Nothing is calibrated again: each structure is the rig with some values changed, so that a row shows what the structure does alone.
"""

import argparse
import sys
import tempfile
from dataclasses import dataclass, field, replace
from pathlib import Path
from unittest.mock import patch

from rig_nodes.rigs.hydmag.laboratory import programme
from rig_nodes.rigs.hydmag.laboratory.programme import BENCHES, PROCEDURES, choose, summary, validate
from rig_nodes.runs import Workers
from rig_nodes.studies import INSIDE

RUN = tuple(name for name in PROCEDURES if name not in BENCHES)
RIGID = """\
description: HydmAG with a rigid input shaft
base: hydmag
bodies:
  rotor: ~
  w0: {inertia: [0.709 kg m2, "thesis 7.3.1: driving side on w0, motor included, by coast-down"]}
shafts:
  input_shaft: ~
parts:
  motor: {body: w0}
  M_wej:
    part: torque_meter
    body: w0
    source: motor
    inertia: [0.0544 kg m2, "as w0 in the rig"]
    side: [within, "the rest of the inertia of w0 is the motor's"]
transducers:
  M_wej: {shows: M_wej}
"""


@dataclass(frozen=True)
class Structure:
    """Changed values, the text of a rig on the base of hydmag, and how long a profile series opens its clutch; "" for the rig's."""

    settings: dict[str, str] = field(default_factory=dict)
    rig: str = ""
    opened: str = ""


VALVES = {
    "pressure_gain": "5.019 MPa/A",
    "cracking_current": "125 mA",
    "hysteresis": "10.27 %",
    "full_opening_pressure": "0.2432 MPa",
    "spool_time": "13.22 ms",
    "orifice_area": "4.701 mm2",
    "drain_area": "4.701 mm2",
    "supply_bore_area": "0.7568 mm2",
    "drain_bore_area": "0.2276 mm2",
}
CLUTCHES = {"hose_give": "0.4244 cm3/MPa", "feed_area": "8.7 mm2", "pack_rate": "5163 N/mm", "pack_travel": "2.858 mm"}
# Values that `rig calibrate`'s rows ask for with all four structures, found by its least squares from near the rig's own.
TOGETHER = {
    **{f"valve_zr_p{k}.{name}": value for k in (1, 2) for name, value in VALVES.items()},
    **{f"clutch_s{k}.{name}": value for k in (1, 2) for name, value in CLUTCHES.items()},
    "clutch_s1.clearance": "1.881 mm",
    "clutch_s2.clearance": "7.002 mm",
    "clutch_s2.drained_volume": "16.09 cm3",
    "plate_pack.rest_torque": "53.64 Nm",
    "plate_pack.friction_kinetic": "0.09279 -",
    "plate_pack.film_time": "255.7 ms",
    "plate_pack.friction_speed": "0.6099 m/s",
    "plate_pack.break_slip": "0.978 mm",
}

# The same for break-away alone, with the friction's four values.
FRICTION = {
    "plate_pack.break_slip": "0.7887 mm",
    "plate_pack.friction_kinetic": "0.09354 -",
    "plate_pack.film_time": "287.7 ms",
    "plate_pack.friction_speed": "0.7689 m/s",
    "plate_pack.rest_torque": "53.21 Nm",
}
LIGHT, BREAK = {"input_shaft.damping": "1.5 Nm s/rad"}, {"plate_pack.break_slip": "1 mm"}
DRAIN = {"valve_zr_p2.drain_bore_area": "0.22 mm2"}
# S2's way back by itself, with a line that runs empty within a second, and with one that stays full between shifts.
BACK_S2 = {"clutch_s2.return_area": "0.72 mm2", "clutch_s2.drain_time": "0.2 s"}
FULL_LINE = {"clutch_s2.return_area": "0.72 mm2", "clutch_s2.drain_time": "3600 s"}
# What least squares finds for S2's oil and clearance with it, the other values held.
BACK_S2_FILL = {"clutch_s2.clearance": "7.3287 mm", "clutch_s2.drained_volume": "16.48 cm3"}
# Annex D's end of p2 asks for 0.89 mm2 with the drain's bore (`rig calculate drains`).
BACK = {"clutch_s1.return_area": "0.72 mm2", "clutch_s2.return_area": "0.72 mm2"}
# What `rig calibrate --generations 0` finds from the rig's own values with that way back and drain_time 0.2 s.
BACK_CALIBRATED = {
    **{
        f"valve_zr_p{k}.{name}": value
        for k in (1, 2)
        for name, value in {
            "pressure_gain": "5.012 MPa/A",
            "cracking_current": "124.61 mA",
            "hysteresis": "10.058 %",
            "full_opening_pressure": "0.23306 MPa",
            "spool_time": "14.937 ms",
            "orifice_area": "2.7769 mm2",
            "drain_area": "2.7769 mm2",
            "supply_bore_area": "0.80089 mm2",
            "drain_bore_area": "0.15439 mm2",
        }.items()
    },
    **{
        f"clutch_s{k}.{name}": value
        for k in (1, 2)
        for name, value in {"feed_area": "10.241 mm2", "pack_rate": "5423.7 N/mm", "pack_travel": "2.9689 mm"}.items()
    },
    "clutch_s1.clearance": "1.8807 mm",
    "clutch_s2.clearance": "7.4456 mm",
    "clutch_s2.drained_volume": "16.211 cm3",
    "clutch_s2.drain_time": "0.2 s",
    "plate_pack.rest_torque": "51.687 Nm",
    "plate_pack.friction_kinetic": "0.092376 -",
    "plate_pack.film_time": "267.82 ms",
    "plate_pack.friction_speed": "0.7099 m/s",
}
STRUCTURES = {
    "rigid input shaft": Structure(rig=RIGID),
    "drain bore of ZR-P2 0.22 mm2": Structure(DRAIN),
    "break-away within 0.8 mm of slip, friction calibrated": Structure(FRICTION),
    "way back of 0.72 mm2 behind the pack": Structure(BACK),
    "way back, calibrated": Structure({**BACK, **BACK_CALIBRATED}),
    "profile series opened for 30 s": Structure(opened="30 s"),
    "profile series opened for 1 s": Structure(opened="1 s"),
    "way back of S2, 0.72 mm2": Structure(BACK_S2),
    "way back of S2, its oil and clearance calibrated": Structure({**BACK_S2, **BACK_S2_FILL}),
    "way back of S2, line stays full between shifts": Structure(FULL_LINE),
    "shaft of 4 % of critical": Structure(LIGHT),
    "4 %, break-away within 1 mm": Structure({**LIGHT, **BREAK}),
    "4 %, break-away, drain bore of ZR-P2 0.22 mm2": Structure({**LIGHT, **BREAK, **DRAIN}),
    "4 %, break-away, hose and drain, calibrated": Structure({**LIGHT, **TOGETHER}),
}


def judged(structure, jobs):
    """Returns (row -> whether it is inside, row -> its role, balanced accuracy of the hold phase) of a structure."""
    series_of = programme.series_of

    def opened(procedure):
        found = series_of(procedure)
        if procedure != "profile_series" or not structure.opened:
            return found
        return [replace(one, parameters={**one.parameters, "open": structure.opened}) for one in found]

    with tempfile.TemporaryDirectory() as folder, Workers(jobs) as workers, patch.object(programme, "series_of", opened):
        rig = "hydmag"
        if structure.rig:
            rig = str(Path(folder) / "rig.yaml")
            Path(rig).write_text(structure.rig)
        result = validate(choose((), RUN), workers, rig, structure.settings)
    rows = {row.target.id: row for row in result.rows if row.target.role in ("predict", "calibrate")}
    inside = {name: row.verdict == INSIDE for name, row in rows.items()}
    return inside, {name: row.target.role for name, row in rows.items()}, summary(result)["hold_balanced_accuracy"]


def main():
    """Prints the table; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("numbers", type=int, nargs="*", metavar="NUMBER")
    parser.add_argument("--jobs", type=int, default=2)
    args = parser.parse_args()
    if any(not 1 <= number <= len(STRUCTURES) for number in args.numbers):
        parser.error(f"NUMBER: {args.numbers} are not all rows of the table, 1 to {len(STRUCTURES)}")
    base, roles, hold = judged(Structure(), args.jobs)

    def counts(inside):
        return ", ".join(f"{sum(inside[name] for name in roles if roles[name] == role)}" for role in ("predict", "calibrate"))

    print(f"| the rig | {counts(base)} | {hold:.3f} | | |", flush=True)
    for number, (name, structure) in enumerate(STRUCTURES.items(), 1):
        if args.numbers and number not in args.numbers:
            continue
        inside, _, hold = judged(structure, args.jobs)
        gained, lost = ([n for n in roles if inside[n] is now and base[n] is not now] for now in (True, False))
        print(f"| {name} | {counts(inside)} | {hold:.3f} | {', '.join(gained)} | {', '.join(lost)} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
