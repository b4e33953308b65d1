# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Opens the exported files of a run, and its bag, with tools of others, and compares the logger's channels bit by bit.

README.md beside it gives the command.
"""

from __future__ import annotations

import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

import asammdf
import numpy as np
import pandas
import pyarrow.parquet as parquet
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader
from scipy.io import loadmat

from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main


def check(run: Path, folder: Path) -> None:
    bag = Bag(run)
    ours = bag.logger().channels
    for kind in ("csv", "parquet", "mf4", "mat"):
        assert main(["export", kind, str(run), "--out", str(folder / f"run.{kind}")]) == 0
    table, columns = pandas.read_csv(folder / "run.csv"), parquet.read_table(folder / "run.parquet")
    frame = pandas.read_parquet(folder / "run.parquet")
    struct = loadmat(folder / "run.mat", simplify_cells=True)["instruments_hmg4000"]
    with asammdf.MDF(folder / "run.mf4") as mdf:
        heads = {head.partition(" [")[0]: head for head in table.columns}
        for name, values in ours.items():
            found = {
                "pandas, CSV": table[heads[name]].dropna(),
                "pandas, Parquet": frame[name].dropna(),
                "pyarrow": columns.column(name).drop_null(),
                "asammdf": mdf.get(name).samples,
                "scipy": struct[name],
            }
            for tool, theirs in found.items():
                assert np.array_equal(np.asarray(theirs), values), (tool, name)
    values = sum(map(len, ours.values()))
    for tool in ("pandas", "pyarrow", "asammdf", "scipy"):
        print(f"{tool} {version(tool)}: {len(ours)} channels, {values} values as in the bag")
    with open(bag.path, "rb") as file:
        count = sum(make_reader(file).get_summary().statistics.channel_message_counts.values())
    with Reader(run) as reader:
        assert count == reader.message_count == sum(bag.counts.values()) == sum(1 for _ in reader.messages())
    print(f"mcap {version('mcap')}, rosbags {version('rosbags')}: {count} messages as in the bag")
    print("exported files: passed")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        check(Path(sys.argv[1]), Path(place))
