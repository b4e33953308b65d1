# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The record that the engine moves, made for one rig: sizes of its driveline, states and values of its parts.

Used by engine.build. Everything lies in one record, so that the compiler sees which values cannot be the same ones; its
beginning, up to and with the driveline's modes, is what a step leaves to the next one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from ..compiled import one_record
from ..parts.part import part
from ..plant.driveline_algebra import work_size
from ..plant.driveline_driven import INPUTS, KEPT, LAWS, WHOLE_NUMBERS
from ..plant.driveline_losses import loss_width

EVENTS = 256  # of the driveline, how many are kept
# pressure in a line [Pa]; rise: in the last step; drawn: flow taken from it since its supply has looked [m3/s]
OIL = np.dtype([("pressure", "f8"), ("rise", "f8"), ("drawn", "f8")])


@dataclass(frozen=True)
class Sizes:
    """How many there are: bodies with a port (of a part or a transducer), and meters of the torque between bodies.

    owned: the driveline's elements that its losses own. driven: shapes of what a driveline keeps beside that has laws or
    inputs over time (plant.driveline_driven), by name; the twists then have places for the integrals of the speeds.
    """

    speeds: int
    elements: int
    shafts: int = 0
    losses: int = 0
    owned: tuple[int, ...] = ()
    bodies: int = 0
    meters: int = 0
    oil_lines: int = 0
    outputs: int = 0
    driven: Mapping[str, tuple[int, ...]] = field(default_factory=dict)


def driveline_dtype(n: Sizes) -> np.dtype:
    """Arguments of driveline_kernel.driveline_step, those that a step changes first, and what parts need of it.

    gain: of the speeds in the last step. speed, gained, rate: of the bodies with a port now, in the last step [rad/s] and
    at its end [rad/s2]; middle: speed that is expected in the middle of the step. push: torque of parts on these bodies at
    both ends of the step. bodies: their speeds by the driveline's. meter: torque between bodies, by the weights meter_of
    of friction torques, pushes and accelerations. own: empty, its shape says which elements the losses own, so that the
    compiler knows.
    """
    s, m = n.speeds, n.elements
    kept, fixed = (
        [(name, "i8" if name in WHOLE_NUMBERS else "f8", n.driven[name]) for name in names if n.driven]
        for names in (KEPT, {**LAWS, **INPUTS})
    )
    return np.dtype(
        [
            ("v", "f8", (s,)),
            ("gain", "f8", (s,)),
            ("el", "f8", (4, m)),
            ("e_in", "f8", (s,)),
            ("loss", "f8", (n.losses, loss_width(s, m))),
            ("own", "f8", (*n.owned, 0)),
            ("twist", "f8", (n.shafts + s * bool(n.driven),)),
            ("shaft", "f8", (2, n.shafts)),
            ("speed", "f8", (n.bodies,)),
            ("gained", "f8", (n.bodies,)),
            ("rate", "f8", (n.bodies,)),
            ("meter", "f8", (n.meters,)),
            *kept,
            ("mode", "i8", (m,)),
            ("minv", "f8", (s, s)),
            ("w", "f8", (m, s)),
            ("sh", "f8", (n.shafts, s)),
            ("kc", "f8", (2, n.shafts)),
            ("q", "f8", (2, s)),
            ("cap", "f8", (7, m)),
            ("middle", "f8", (n.bodies,)),
            ("push", "f8", (2, n.bodies)),
            ("bodies", "f8", (n.bodies, s)),
            ("meter_of", "f8", (n.meters, m + n.bodies + s)),
            ("events", "f8", (EVENTS, 3)),
            ("count", "i8", (2,)),
            ("work", "f8", (work_size(s, m, n.shafts, n.losses),)),
            *fixed,
        ]
    )


def world_dtype(counts: dict[str, int], sizes: Sizes, shapes: dict[str, tuple[int, ...]]) -> np.dtype:
    """The record of a rig with so many instances of each part; shapes: of the parts' tables.

    safe > 0: the rig is in its safe state. channel: column of the logger with the coil current of each output of the
    controller, NOWHERE without one; current: these currents.
    """
    states = np.dtype([(name, part(name).state_dtype(), (count,)) for name, count in counts.items()])
    values = np.dtype([(name, part(name).values_dtype(shapes), (count,)) for name, count in counts.items()])
    return one_record(
        np.dtype(
            [
                ("safe", "f8"),
                ("oil", OIL, (sizes.oil_lines,)),
                ("parts", states),
                ("driveline", driveline_dtype(sizes)),
                ("values", values),
                ("channel", "u8", (sizes.outputs,)),
                ("current", "f8", (sizes.outputs,)),
            ]
        )
    )


@lru_cache(maxsize=8)
def places(dtype: np.dtype) -> tuple[str, ...]:
    """Name of each number of 8 bytes in a record, e.g. "parts.wet_clutch[1].temperature"."""
    return tuple(_places(dtype, ""))


def _places(dtype: np.dtype, name: str) -> Iterator[str]:
    if dtype.subdtype:
        base, shape = dtype.subdtype
        for index in np.ndindex(shape):
            yield from _places(base, f"{name}{list(index)}")
    elif dtype.names is None:
        yield name
    else:
        for one in dtype.names:
            yield from _places(dtype[one], f"{name}.{one}" if name else one)
