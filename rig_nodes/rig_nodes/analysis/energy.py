# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Energy balance of a run or of one shift, from energies that the plant integrates one by one.

analysis.run_report uses it; the tests compare the residual with the clutch heat of the same window.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base import RigError
from ..plant import part as parts
from ..rig import Structure, Transmission

if TYPE_CHECKING:
    from ..bags import Bag
    from .gathered import Gathered

Series = tuple[np.ndarray, np.ndarray]
OWN_ACCOUNT, RESIDUAL = "/rig/state", "energy_residual"


def signs(box: Transmission) -> dict[str, float]:
    """Return the sign of each energy in the balance, by its name.

    Energies with + enter the gearbox; energies with - leave it or stay in it. A full account sums to 0.
    """
    return {
        "motor_work": 1.0,
        "load_work": -1.0,
        **{clutch.heat: -1.0 for clutch in box.clutches},
        "heat_losses": -1.0,
        "stored_kinetic": -1.0,
        "stored_hydraulic": -1.0,
    }


def energy_names(box: Transmission) -> dict[str, str]:
    """Return the name for people of each energy of :func:`signs`."""
    return {
        "motor_work": "work of the drive",
        "load_work": "work done on the load",
        **{clutch.heat: f"heat of clutch {clutch.name}" for clutch in box.clutches},
        "heat_losses": "heat of gears and bearings",
        "stored_kinetic": "growth of kinetic energy",
        "stored_hydraulic": "growth of hydraulic energy",
    }


def needed(box: Transmission) -> tuple[str, ...]:
    """Return the names of the energies without which there is no balance."""
    return ("motor_work", *(clutch.heat for clutch in box.clutches), "stored_kinetic")


def fields(structure: Structure, box: Transmission) -> dict[str, dict[str, str]]:
    """Return the message fields to read: topic -> name of the energy (or speed) -> field."""
    works = {
        f"/{device.name}/state": {name: shown.field}
        for role, name in ((parts.LOAD, "load_work"), (parts.SOURCE, "motor_work"))
        for device in structure.of_role(role)[:1]
        for shown in parts.part(device.part).shows
        if shown.of == "energy"
    }  # the message of each one carries the sum over all devices of its role
    return {
        **works,
        **{clutch.state: {clutch.heat: "heat"} for clutch in box.clutches},
        "/gearbox/state": {"heat_losses": "heat", "w_in": "speed_in", "w_out": "speed_out"},
    }


def all_fields(structure: Structure, box: Transmission) -> dict[str, dict[str, str]]:
    """Return :func:`fields` and, for a rig of which something turns separately, the rig's own account."""
    own = {} if all_turn_with(structure) else {OWN_ACCOUNT: {"residual": RESIDUAL}}
    return fields(structure, box) | own


def balance(energies: dict[str, Series], t_start: float, t_end: float, box: Transmission) -> dict[str, float | None]:
    """Return the energy account of a window.

    The window is widened to the samples of motor_work around it, so that the balance is taken between existing values
    instead of interpolated ones, and is cut to the recorded time.

    Parameters
    ----------
    energies : dict of str to (times, values)
        For each name of :func:`signs` the times [s] and the energy since time 0 or the stored energy [J], both (n,). The
        gearbox losses and the hydraulic energy are optional.
    t_start, t_end : float
        The window [s].
    box : Transmission
        That of the rig.

    Returns
    -------
    dict
        t_start_s, t_end_s, one ``<name>_j`` for each energy (None for one not given), residual_j (work that went in and is
        not found anywhere) and residual_of_heat, its share of the clutch heat in the window (None without clutch heat).

    Raises
    ------
    RigError
        When a needed energy is missing or has no samples, or the window lies outside the recording.
    """
    missing = [name for name in needed(box) if name not in energies or len(energies[name][0]) == 0]
    if missing:
        raise RigError(f"the energy balance has no {', '.join(missing)}; it needs {', '.join(needed(box))}")
    times = np.asarray(energies["motor_work"][0], dtype=float)
    if t_end <= t_start or t_end < times[0] or t_start > times[-1]:
        raise RigError(
            f"the energy balance was asked for {t_start:.3f} s to {t_end:.3f} s, "
            f"but the recording has {times[0]:.3f} s to {times[-1]:.3f} s"
        )
    # 1 ns of tolerance, so that a window given on a sample stays there
    first = times[max(0, np.searchsorted(times, t_start + 1e-9, side="right") - 1)]
    last = times[min(times.size - 1, np.searchsorted(times, t_end - 1e-9, side="left"))]
    account: dict[str, float | None] = {"t_start_s": float(first), "t_end_s": float(last)}
    residual = 0.0
    for name, sign in signs(box).items():
        if name not in energies:
            account[f"{name}_j"] = None
            continue
        t, energy = energies[name]
        change = float(np.interp(last, t, energy) - np.interp(first, t, energy))
        account[f"{name}_j"] = change
        residual += sign * change
    heat = clutch_heat(account, box)
    account["residual_j"] = residual
    account["residual_of_heat"] = residual / heat if heat > 0.0 else None
    return account


def clutch_heat(account: dict[str, float | None], box: Transmission) -> float:
    """Return the heat of all clutches [J] in an account of :func:`balance`."""
    return sum(account[f"{clutch.heat}_j"] for clutch in box.clutches)


def energies_of(bag: Bag | Gathered, box: Transmission) -> dict[str, Series]:
    """Return the energies for :func:`balance` from a bag's state topics (200 Hz).

    The kinetic energy is that of the two shafts with everything that turns with them. Where something turns separately, as in a
    planetary set, it is the remainder of the rig's own account. Topics without messages are left out, so that balance() can
    name them.

    Parameters
    ----------
    bag : Bag or Gathered
        The recording.
    box : Transmission
        That of the bag's rig.

    Returns
    -------
    dict of str to (times, values)
        Times [s] and energy [J] by name.
    """
    structure, energies = bag.structure, {}
    for topic, names in fields(structure, box).items():
        t, columns = bag.fields(topic, list(names.values()))
        if len(t):
            energies.update((name, (t, column)) for name, column in zip(names, columns))
    if "w_in" in energies:
        t, w_in = energies.pop("w_in")
        _, w_out = energies.pop("w_out")
        if all_turn_with(structure):
            energies["stored_kinetic"] = (t, box.inertias.kinetic(w_in, w_out))
        else:
            energies["stored_kinetic"] = _left(bag, energies, box)
    return energies


def all_turn_with(structure: Structure) -> bool:
    """Return True when gear wheels tie everything that has inertia to the input or the output shaft."""
    known = {end.body for end in (structure.input, structure.output)}
    while more := {body for mesh in structure.meshes for body in mesh.bodies if known & set(mesh.bodies)} - known:
        known |= more
    lossy = (one.lossy or one.table for one in (*structure.meshes, *structure.planetary_sets))
    gives_way = structure.shafts or structure.elements or any(lossy)
    return not gives_way and set(structure.bodies) - set(structure.massless) <= known


def _left(bag: Bag | Gathered, energies: dict[str, Series], box: Transmission) -> Series:
    """Return the stored energy by the rig's own account, which includes every body: works less heats and its residual."""
    t, (residual,) = bag.fields(OWN_ACCOUNT, [RESIDUAL])
    stored = -residual
    for name, sign in signs(box).items():
        if name in energies:
            stored = stored + sign * np.interp(t, *energies[name])
    return t, stored
