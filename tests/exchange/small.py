# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Small files in which one thing is as a logger may write it, and the measurement that is read from them."""

from __future__ import annotations

import functools

import numpy as np

from rig_nodes.bags.exchange.imported import read_measurement
from rig_nodes.bags.exchange.profile import read_profile
from rig_nodes.rig.configuration import load_rig

HEADS = ("M_wej [Nm]", "n_wej [rpm]", "M_wyj [Nm]", "n_wyj [rpm]", "p1 [bar]", "p2 [bar]")
ROWS = 400
SECONDS = [f"{3 + k / 1000:.3f}".replace(".", ",") for k in range(ROWS)]


@functools.cache
def hydmag():
    return load_rig("hydmag").as_dict()


def values(k):
    """Values of row k in the units of HEADS; the speed is 1500 and 1501 rpm by turns."""
    return 10.25 + k % 3, 1500.0 + k % 2, 80.5, 1085.25, 23.5, 0.125 + k % 2


def table(times=SECONDS, head="t [s]", sep=";", decimal=",", above="", **others):
    """Text of a file whose times stand as they are given; ``others`` maps heads of more columns to functions of the row."""
    lines = [sep.join([*([head] if head else []), *HEADS, *others])]
    for k, time in enumerate(times):
        cells = [f"{x:.3f}".replace(".", decimal) for x in values(k)]
        lines.append(sep.join([*([time] if head else []), *cells, *(one(k) for one in others.values())]))
    return above + "\n".join(lines) + "\n"


def measured(folder, text, name="a.csv", profile=None, orders=None):
    """The measurement of a file with this text or these bytes."""
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    if profile is not None:
        (folder / "p.yaml").write_text(f"rig: hydmag\n{profile}", encoding="utf-8")
        profile = read_profile(folder / "p.yaml")
    return read_measurement(path, profile, hydmag(), "--rig", orders)


def rpm(found, rows=2):
    """The first input speeds of a measurement [rpm]."""
    return (found.channels["n_wej"][:rows] * 30.0 / np.pi).tolist()
