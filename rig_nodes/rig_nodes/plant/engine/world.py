# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The record that the engine moves, made for one rig: sizes of its driveline, states and values of its parts.

Used by engine.build. Everything is in one record, so that it is clear to the compiler which values cannot share memory. The
beginning of the record, up to and including the modes of the driveline, is what a step leaves to the next one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from ...base import one_record
from ...driveline import FIELDS, INPUTS, KEPT, LAWS, SIZES, WHOLE_NUMBERS, Room, loss_width, room_shapes, work_size
from ..parts.part import part

EVENTS = 256  # number of the driveline's events that are kept
# pressure: pressure at the end of a line, where it is measured [Pa]; port: that at its valve [Pa]; rise: rise of the latter in the
# last step; drawn, heat: flow drawn from it [m3/s] and heat put into it [J] since its supply last read these values
OIL = np.dtype([("pressure", "f8"), ("port", "f8"), ("rise", "f8"), ("drawn", "f8"), ("heat", "f8")])


@dataclass(frozen=True)
class Sizes:
    """Sizes of a rig's record.

    Parameters
    ----------
    speeds, elements, shafts, losses : int
        Numbers of the driveline's speeds, friction elements, shafts and losses by torque.
    owned : tuple of int
        The driveline's elements that its losses own.
    bodies : int
        Number of bodies with a port of a part or a transducer.
    meters : int
        Number of meters of the torque between bodies.
    oil_lines, outputs : int
        Numbers of oil lines and of outputs of the controller.
    driven : mapping of str to tuple of int
        Shapes, by name, of the further arrays of a driveline that has laws or inputs over time (driveline.driven); the
        twists then have places for the integrals of the speeds.
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
    """Return the type of the driveline's record: the arguments of driveline.kernel.driveline_step and what parts need of it.

    Arguments that a step changes come first. The other fields are: gain: change of the speeds in the last step; speed, gained,
    rate: of the bodies with a port the speed, its change in the last step [rad/s] and the acceleration at its end [rad/s2]; middle:
    speed that is expected in the middle of the step; push: torque of parts on these bodies at both ends of the step; bodies: speeds
    of these bodies by those of the driveline; meter: torque between bodies, by the weights meter_of of friction torques, pushes,
    torques of shafts and accelerations; own: an empty array whose shape contains the numbers of the elements that the losses own,
    for the compiler.

    Parameters
    ----------
    n : Sizes
        Sizes of the record.

    Returns
    -------
    numpy.dtype
        Type of the record.
    """
    s, m = n.speeds, n.elements
    kept, fixed = (
        [(name, "i8" if name in WHOLE_NUMBERS else "f8", n.driven[name]) for name in names if n.driven]
        for names in (KEPT, (*LAWS, *INPUTS))
    )
    room = room_shapes(s, m, n.shafts, n.driven["kind"][0], n.driven["default"][0]) if n.driven else ()
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
            ("meter_of", "f8", (n.meters, m + n.bodies + n.shafts + s)),
            ("events", "f8", (EVENTS, 3)),
            ("count", "i8", (3,)),
            ("work", "f8", (work_size(s, m, n.shafts, n.losses),)),
            *fixed,
            *[(name, "f8", shape) for name, shape in zip(Room._fields, room)],
            *[("layout", "i8", (SIZES + len(FIELDS),))] * bool(room),
        ]
    )


def world_dtype(counts: dict[str, int], sizes: Sizes, shapes: dict[str, tuple[int, ...]]) -> np.dtype:
    """Return the type of a rig's record.

    Field safe > 0: the rig is in its safe state; channel: column of the logger with the coil current of each output of the
    controller, NOWHERE without one; current: these currents.

    Parameters
    ----------
    counts : dict of str to int
        Number of instances of each part.
    sizes : Sizes
        Sizes of the record.
    shapes : dict of str to tuple of int
        Shapes of the tables of the parts.

    Returns
    -------
    numpy.dtype
        Type of the record.
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


def beginning(dtype: np.dtype) -> np.dtype:
    """Return the type of the beginning of a rig's record, which a step leaves to the next one; its fields have the same names."""
    line = _first_fields(dtype["driveline"], "mode")
    return _first_fields(dtype, "driveline", line)


def _first_fields(dtype: np.dtype, last: str, form: np.dtype | None = None) -> np.dtype:
    """Return the type with the fields up to the last one, which may have another form."""
    names = list(dtype.names or ())
    names = names[: names.index(last) + 1]
    places: dict[str, int] = {name: entry[1] for name, entry in (dtype.fields or {}).items()}
    formats = [form if name == last and form is not None else dtype[name] for name in names]
    end = places[last] + formats[-1].itemsize
    return np.dtype({"names": names, "formats": formats, "offsets": [places[name] for name in names], "itemsize": end})


@lru_cache(maxsize=8)
def places(dtype: np.dtype) -> tuple[str, ...]:
    """Return the name of each number of 8 bytes in a record, e.g. "parts.wet_clutch[1].temperature"."""
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
