# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The record of a rig's driveline that has laws, lossy meshes or inputs over time, as the compiled steps read it.

Used by driveline/driven.py and driveline/quick.py, which are compiled once for all rigs: they get the places of the record's fields
and make the arrays from them, instead of some seventy arrays, each of seven machine words. plant/engine/world.py makes the record.
numba's own function for arrays at an address is no use here, because importing it would load numba wherever a rig is read.
"""

from __future__ import annotations

from collections import namedtuple
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rig_nodes.base import ALLOCATES, INLINED, njit
from rig_nodes.driveline.algebra import places
from rig_nodes.driveline.arrays import address, floats, whole
from rig_nodes.driveline.laws import Laws, LawState
from rig_nodes.driveline.losses import WEIGHTS
from rig_nodes.driveline.state import Loads, State, Structure
from rig_nodes.driveline.tables import Tables

if TYPE_CHECKING:
    from rig_nodes.base import Floats, Ints

# Names of the record's arrays. Of the laws, with their tables:
LAWS = (*Laws._fields[:-1], "first_point", "x", "y", "ends", "period")
# the state of the laws, the work of the parts' torques on bodies, and the accelerations at the step's end:
KEPT = ("at", "law_torque", "spring", "way", "law_work", "part_work", "accel")
# the inputs over time: kind, place and row of the speeds of each, and their points; the ratios of stick limit to capacity of the
# elements; the defaults of the laws' inputs; the mass matrix; torques and capacities at the end of the last step, and whether there
# was a step before
INPUTS = (
    *("given_kind", "given_place", "given_on", "given_first", "given_x", "given_y", "given_ends", "given_period"),
    *("stick", "default", "mass", "q_before", "cap_before", "begun"),
)
WHOLE_NUMBERS = (*Laws._fields[:6], "first_spring", "first_point", "given_kind", "given_place", "given_first")


class OverTime(NamedTuple):
    """The inputs over time of a driveline.

    Parameters
    ----------
    kind : (inputs,) array of int64
        FACTOR, LIMIT or PUSH of driveline.driven.
    place : (inputs,) array of int64
        Number of the law's input, or of the friction element.
    on : (inputs, n) array
        Row of the speeds on which a PUSH acts.
    tables : Tables
        The tables over time [s].
    stick : (2, m) array
        Ratios of stick limit to capacity of the elements, forwards and backwards.
    default : (factors,) array
        Defaults of the laws' inputs.
    """

    kind: Ints
    place: Ints
    on: Floats
    tables: Tables
    stick: Floats
    default: Floats


class Before(NamedTuple):
    """What was at the end of the last step.

    Parameters
    ----------
    q : (n,) array
        Forces on the speeds [Nm].
    cap : (7, m) array
        Capacities, of which row 1 of each pair counts.
    begun : (1,) array
        1 when there was a step.
    """

    q: Floats
    cap: Floats
    begun: Floats


class Outcome(NamedTuple):
    """What the rig reads after a step.

    Parameters
    ----------
    part_work : (1,) array
        Work of the torques of parts on bodies so far [J].
    accel : (n,) array
        Accelerations of the speeds at the step's end [rad/s2].
    """

    part_work: Floats
    accel: Floats


class Room(NamedTuple):
    """Room for the results of a quick step, of which only those of the matrix are read by the next one.

    Parameters
    ----------
    made : (3,) array
        Whether, for which step [s] and for which set of stuck elements its matrix was made.
    q_now, cap_given, cap_now, kc_now : (2, n), (7, m), (7, m) and (2, s) arrays
        Forces, capacities without and with laws, and shafts with laws, over the step.
    by_law, by_element, by_slot, by_speed, by_input : (16, laws), (6, m), (4, s), (5, n) and (2, factors) arrays
        As those of driveline.quick_laws.Quick.
    """

    made: Floats
    q_now: Floats
    cap_given: Floats
    cap_now: Floats
    kc_now: Floats
    by_law: Floats
    by_element: Floats
    by_slot: Floats
    by_speed: Floats
    by_input: Floats


FIELDS = (*Structure._fields, *Loads._fields, "loss", *State._fields, *LAWS, *KEPT, *INPUTS, *Room._fields)
# a layout begins with the numbers of speeds, elements, shafts, losses, laws, inputs over time, inputs of laws, springs, events and
# tables of laws
SIZES = 10
# where the place of each field is in a layout
AT: Any = namedtuple("AT", FIELDS)(*range(SIZES, SIZES + len(FIELDS)))  # type: ignore[misc]


def room_shapes(n: int, m: int, slots: int, laws: int, factors: int) -> Room:
    """Return the shapes of a quick step's room, in place of its arrays.

    Parameters
    ----------
    n, m, slots, laws, factors : int
        Numbers of speeds, friction elements, rows of shafts, laws, and inputs of laws.

    Returns
    -------
    Room
        The shapes.
    """
    return Room((3,), (2, n), (7, m), (7, m), (2, slots), (16, laws), (6, m), (4, slots), (5, n), (2, factors))


def layout_of(dtype: np.dtype) -> np.ndarray:
    """Return the sizes of a driveline's record and the places of its fields [bytes from its field ``layout``], as steps read them.

    Parameters
    ----------
    dtype : numpy.dtype
        Type of the record, with FIELDS and ``layout``.

    Returns
    -------
    (SIZES + fields,) array of int64
        The layout.
    """

    def shape(name: str) -> tuple[int, ...]:
        return dtype[name].shape

    (m, n), laws = shape("w"), shape("kind")[0]
    sizes = [n, m, shape("sh")[0], shape("loss")[0], laws, shape("given_kind")[0], shape("default")[0]]
    sizes += [shape("spring")[0], shape("events")[0], shape("period")[0]]
    places = {name: entry[1] for name, entry in (dtype.fields or {}).items()}
    return np.array([*sizes, *(places[name] - places["layout"] for name in FIELDS)], np.int64)


@njit(**INLINED)
def structure_at(layout: Ints) -> Structure:
    """Return the structure of a driveline's record."""
    base, n, m, slots = address(layout), layout[0], layout[1], layout[2]
    return Structure(
        floats(base + layout[AT.minv], n, n),
        floats(base + layout[AT.w], m, n),
        floats(base + layout[AT.sh], slots, n),
        floats(base + layout[AT.kc], 2, slots),
    )


@njit(**INLINED)
def loads_at(layout: Ints) -> Loads:
    """Return the loads of a driveline's record."""
    base = address(layout)
    return Loads(floats(base + layout[AT.q], 2, layout[0]), floats(base + layout[AT.cap], 7, layout[1]))


@njit(**ALLOCATES)  # without references counted numba returns only arrays that were given
def loss_at(layout: Ints) -> Floats:
    """Return the losses by torque of a driveline's record."""
    return floats(address(layout) + layout[AT.loss], layout[3], WEIGHTS + layout[1] + layout[0])


@njit(**INLINED)
def state_at(layout: Ints) -> State:
    """Return the state of a driveline's record."""
    base, n, m, slots = address(layout), layout[0], layout[1], layout[2]
    return State(
        floats(base + layout[AT.v], n),
        floats(base + layout[AT.twist], slots + n),
        whole(base + layout[AT.mode], m),
        floats(base + layout[AT.el], 4, m),
        floats(base + layout[AT.shaft], 2, slots),
        floats(base + layout[AT.e_in], n),
        floats(base + layout[AT.events], layout[8], 3),
        whole(base + layout[AT.count], 3),
        floats(base + layout[AT.work], places(n, m, slots, layout[3]).size),
    )


@njit(**INLINED)
def laws_at(layout: Ints) -> Laws:
    """Return the laws of a driveline's record; the lengths of points and values are not right, as nothing reads them."""
    base, n, laws = address(layout), layout[0], layout[4]
    return Laws(
        whole(base + layout[AT.kind], laws),
        whole(base + layout[AT.by], laws),
        whole(base + layout[AT.slot], laws),
        whole(base + layout[AT.element], laws),
        whole(base + layout[AT.factor], laws),
        whole(base + layout[AT.second], laws),
        floats(base + layout[AT.of], laws, n),
        floats(base + layout[AT.on], laws, n),
        floats(base + layout[AT.gap], laws),
        floats(base + layout[AT.damping], laws),
        whole(base + layout[AT.first_spring], laws + 1),
        floats(base + layout[AT.springs], layout[7], 2),
        Tables(
            whole(base + layout[AT.first_point], layout[9] + 1),
            floats(base + layout[AT.x], 1),
            floats(base + layout[AT.y], 1),
            floats(base + layout[AT.ends], layout[9], 2),
            floats(base + layout[AT.period], layout[9]),
        ),
    )


@njit(**INLINED)
def own_at(layout: Ints) -> LawState:
    """Return the state of the laws in a driveline's record."""
    base, laws = address(layout), layout[4]
    return LawState(
        floats(base + layout[AT.at], laws),
        floats(base + layout[AT.law_torque], laws),
        floats(base + layout[AT.spring], layout[7]),
        floats(base + layout[AT.way], laws),
        floats(base + layout[AT.law_work], 1),
    )


@njit(**INLINED)
def over_time_at(layout: Ints) -> OverTime:
    """Return the inputs over time of a driveline's record; the lengths of points and values are not right."""
    base, inputs = address(layout), layout[5]
    return OverTime(
        whole(base + layout[AT.given_kind], inputs),
        whole(base + layout[AT.given_place], inputs),
        floats(base + layout[AT.given_on], inputs, layout[0]),
        Tables(
            whole(base + layout[AT.given_first], inputs + 1),
            floats(base + layout[AT.given_x], 1),
            floats(base + layout[AT.given_y], 1),
            floats(base + layout[AT.given_ends], inputs, 2),
            floats(base + layout[AT.given_period], inputs),
        ),
        floats(base + layout[AT.stick], 2, layout[1]),
        floats(base + layout[AT.default], layout[6]),
    )


@njit(**INLINED)
def before_at(layout: Ints) -> Before:
    """Return what a driveline's record has of the end of the last step."""
    base = address(layout)
    return Before(
        floats(base + layout[AT.q_before], layout[0]),
        floats(base + layout[AT.cap_before], 7, layout[1]),
        floats(base + layout[AT.begun], 1),
    )


@njit(**INLINED)
def outcome_at(layout: Ints) -> Outcome:
    """Return what a rig reads of a driveline's record after a step."""
    base = address(layout)
    return Outcome(floats(base + layout[AT.part_work], 1), floats(base + layout[AT.accel], layout[0]))


@njit(**INLINED)
def room_at(layout: Ints) -> Room:
    """Return the room of a quick step in a driveline's record."""
    base, n, m, slots = address(layout), layout[0], layout[1], layout[2]
    return Room(
        floats(base + layout[AT.made], 3),
        floats(base + layout[AT.q_now], 2, n),
        floats(base + layout[AT.cap_given], 7, m),
        floats(base + layout[AT.cap_now], 7, m),
        floats(base + layout[AT.kc_now], 2, slots),
        floats(base + layout[AT.by_law], 16, layout[4]),
        floats(base + layout[AT.by_element], 6, m),
        floats(base + layout[AT.by_slot], 4, slots),
        floats(base + layout[AT.by_speed], 5, n),
        floats(base + layout[AT.by_input], 2, layout[6]),
    )
