# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The driveline's steps as the engine calls them: by their address, with the arrays of a rig's record.

Used by plant.engine.step: the general step where a step is not a quiet one, and the driven step for rigs with laws or inputs over
time. Both are compiled once for all rigs, in parallel with the rest, and are not needed before the first step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from ...base import INLINED, njit, types
from ...driveline import (
    Loads,
    State,
    Structure,
    address_of,
    bare_address,
    bare_step,
    call_of,
    driven_step,
    quick_address,
    quick_types,
    settled_address,
)

if TYPE_CHECKING:
    from ...base import Record


class Addresses(NamedTuple):
    """Addresses at which the driveline's compiled steps begin in this process; 0 for one that is not used.

    Parameters
    ----------
    bare, settled, driven, quick : int
        Of driveline.kernel.driveline_step, driveline.law_steps.settled_step, driveline.driven.driven_step and
        driveline.quick.quick_step.
    """

    bare: int
    settled: int = 0
    driven: int = 0
    quick: int = 0


NONE = Addresses(0)


def driven_types() -> tuple:
    """Return the types of the arguments of `driven_step`."""
    return types.int64, types.int64, *quick_types()


def addresses(driven: bool = False) -> Addresses:
    """Return the addresses of the steps, which are compiled or read from the cache.

    Parameters
    ----------
    driven : bool
        Whether the driveline has laws or inputs over time.

    Returns
    -------
    Addresses
        The addresses; for a driveline that is not driven that of the bare step alone.
    """
    if not driven:
        return Addresses(bare_address())
    return Addresses(bare_address(), settled_address(), address_of(driven_step, driven_types()), quick_address())


_driven_step = call_of(lambda _: driven_types())
_quick_step = call_of(lambda _: quick_types())


@njit(**INLINED)
def general_step(at: Addresses, h: float, t: float, line: Record) -> None:
    """Move a driveline's record from t over h by the bare step."""
    structure, loads = Structure(line.minv, line.w, line.sh, line.kc), Loads(line.q, line.cap)
    state = State(line.v, line.twist, line.mode, line.el, line.shaft, line.e_in, line.events, line.count, line.work)
    bare_step(at.bare, h, t, structure, loads, line.loss, state)


@njit(**INLINED)
def driven_step_at(at: Addresses, h: float, t: float, line: Record) -> None:
    """Move a driveline's record from t over h by the driven step; the record must have the arrays that this step needs."""
    _driven_step(at.driven, at.settled, at.bare, line.layout, h, t)


@njit(**INLINED)
def quick_step_at(at: Addresses, h: float, t: float, line: Record) -> bool:
    """Move a driveline's record from t over h by the quick step, and return whether that has done it."""
    return _quick_step(at.quick, line.layout, h, t) != 0
