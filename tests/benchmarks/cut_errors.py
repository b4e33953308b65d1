# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The difference between a run with devices cut out and the same run without: the table of docs/how_to/cuts.md.

.venv/bin/python tests/benchmarks/cut_errors.py [SEQUENCE]
"""

import sys
import tempfile
from pathlib import Path

from rig_nodes.analysis.run_report import build_report
from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.outputs import Outputs
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.sequence_runner import SequenceRunner
from rig_nodes.runs.simulation import LocalBench, simulate

TIMES = ("t_dt_s", "t_p_s", "t_c_s", "t_o_s", "overlap_s")
CASES = [*((device,) for device in load_rig("hydmag").cuttable), load_rig("hydmag").cuttable]
TICKS = ("1 ms", "2 ms", "5 ms")


def settings(devices, tick):
    """Returns the overrides that cut these devices out."""
    return {"cut.tick": tick, **{f"{device}.source": "topic" for device in devices}}


def shifts(sequence, values=None):
    """Returns the shifts in the report of a simulated sequence."""
    with tempfile.TemporaryDirectory() as folder:
        run = simulate(load_rig("hydmag", values), sequence, Path(folder))
        return build_report(Bag(folder), run)


def errors(reference, report) -> dict[str, float]:
    """Returns the greatest differences over all shifts: peak torque [share], times [s], k, settled loss [share]."""
    pairs = list(zip(reference["shifts"], report["shifts"], strict=True))
    return {
        "peak": max(abs(b["input_torque_max_nm"] / a["input_torque_max_nm"] - 1.0) for a, b in pairs),
        "times": max(abs(b[name] - a[name]) for a, b in pairs for name in TIMES),
        "k": max(abs(b["k"] - a["k"]) for a, b in pairs),
        "loss": max(abs(b["e_loss_settled_j"] / a["e_loss_settled_j"] - 1.0) for a, b in pairs),
    }


def works(sequence, values) -> dict[str, tuple[float, float]]:
    """Returns the energy over each cut at the end of the sequence [J]: (counted by the plant, counted by the device)."""
    config = load_rig("hydmag", values)
    rig = Rig(config)
    outputs = Outputs(rig, {}, commands=True)
    runner = SequenceRunner(sequence, LocalBench(rig, outputs), config)
    while not (rig.sample and rig.sample % 5 == 0 and runner.poll(rig.time)):
        list(outputs.due())
        rig.advance_samples(1)
    cuts = rig.cuts
    return {device: (cuts.work(device), cuts.answered(device)[1].work) for device in cuts.devices}


def main() -> int:
    """Prints the table."""
    sequence = load_sequence(sys.argv[1] if len(sys.argv) > 1 else "demo", default="hydmag")
    reference = shifts(sequence)
    print("| cut out | tick | peak M_wej | times | k | loss | balance | work: plant, device |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for tick in TICKS:
        for devices in CASES:
            values = settings(devices, tick)
            name = "all four" if devices == load_rig("hydmag").cuttable else devices[0]
            try:
                report = shifts(sequence, values)
            except RigError:  # the motor's speed loop is not stable with this tick
                print(f"| {name} | {tick} | refused, see below | | | | | |", flush=True)
                continue
            e = errors(reference, report)
            both = "; ".join(f"{a:.1f} J, {b:.1f} J" for a, b in works(sequence, values).values())
            balance = report["energy"]["run"]["residual_j"]
            print(
                f"| {name} | {tick} | {100 * e['peak']:.2f} % | {1e3 * e['times']:.1f} ms | {e['k']:.4f} "
                f"| {100 * e['loss']:.2f} % | {balance:+.1e} J | {both} |",
                flush=True,
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
