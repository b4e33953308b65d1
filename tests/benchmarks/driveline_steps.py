# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a step of a driveline costs in Python alone, here and in another checkout: elements that a description does not use must not
make it slower.

.venv/bin/python tests/benchmarks/driveline_steps.py [--against CHECKOUT] [--rounds N]    # CHECKOUT has a .venv of its own

Each round measures every driveline once here and once there, in a process of its own; the least time of all rounds counts. The
descriptions use only what the first version of the description had. A run writes down the angles of all bodies too, which that
version did not; this is half of what it may take longer.
"""

import argparse
import subprocess
import sys
import time
from pathlib import Path

from rig_nodes.driveline import run as driveline_run
from rig_nodes.driveline.builder import Driveline

STEPS = 50_000
STEP_S = 1e-4


def two_bodies():
    """Two bodies and an open clutch."""
    d = Driveline()
    d.inertia("a", 1.0, speed=1.0)
    d.inertia("b", 2.0)
    d.clutch("k", "a", "b")
    return d, {"a": 5.0}


def four_bodies():
    """Two clutches, one of them with drag, and a shaft between four bodies."""
    d = Driveline()
    for name, j, speed in (("a", 0.3, 10.0), ("b", 0.5, 0.0), ("c", 2.0, 0.0), ("d", 1.0, 0.0)):
        d.inertia(name, j, speed=speed)
    d.clutch("k", "a", "b")
    d.shaft("s", "b", "c", stiffness=1e4, damping=2.0)
    d.clutch("l", "c", "d", drag=0.01)
    return d, {"a": 5.0, "k": 1.0, "l": 0.5}


def eleven_bodies():
    """A chain of eleven bodies on ten shafts."""
    d = Driveline()
    for k in range(11):
        d.inertia(f"j{k}", 1.0, speed=float(k))
    for k in range(10):
        d.shaft(f"s{k}", f"j{k}", f"j{k + 1}", stiffness=1e4, damping=1.0)
    return d, {"j0": 5.0}


DRIVELINES = (two_bodies, four_bodies, eleven_bodies)


def measured():
    """Returns the least time of a step [us] of each driveline, out of seven runs; only the compiled steps are timed."""
    run_steps, took, out = driveline_run._run_steps, [], []

    def timed(*arguments):
        begin = time.thread_time()
        run_steps(*arguments)
        took.append(time.thread_time() - begin)

    driveline_run._run_steps = timed
    for make in DRIVELINES:
        d, inputs = make()
        system, runs = d.build(), []
        for _ in range(7):
            driveline_run.run(system, STEPS * STEP_S, STEP_S, inputs)
            runs.append(took[-1])
        out.append(min(runs) / STEPS * 1e6)
    return out


def of(checkout):
    """Returns what `measured` finds in a checkout, in a process of its own."""
    python = str(Path(checkout) / ".venv" / "bin" / "python")
    done = subprocess.run([python, __file__, "--once"], capture_output=True, text=True, check=True, cwd=checkout)
    return [float(number) for number in done.stdout.split()]


def main():
    """Prints a line for each driveline; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--against", metavar="CHECKOUT")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--once", action="store_true", help="one measurement of this process, numbers only")
    args = parser.parse_args()
    if args.once:
        print(*measured())
        return 0
    here = Path(__file__).parents[2]
    checkouts = [here] if args.against is None else [here, Path(args.against)]
    rounds = [[of(checkout) for checkout in checkouts] for _ in range(args.rounds)]
    for k, make in enumerate(DRIVELINES):
        best = [min(one[place][k] for one in rounds) for place in range(len(checkouts))]
        ratio = f", {best[1]:.3f} us there, ratio {best[0] / best[1]:.2f}" if args.against else ""
        print(f"{make.__doc__} {best[0]:.3f} us a step{ratio}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
