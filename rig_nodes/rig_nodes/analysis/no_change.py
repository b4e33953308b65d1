# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measurements of a run without a change between gears: a valve at standstill, an engagement from neutral, a coast-down.

analysis.run_report uses it for such a run, which has no shift to show. The evaluations are those of the measuring
procedures: valve_response, engagement, coast_down.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..bags import Recording
from ..base import SAMPLE, RigError
from ..rig import CONTROLLER_COMMAND, Transmission
from .coasting import coast_down
from .definitions import RPM, STANDSTILL
from .display import in_unit, shown
from .engagement import engagement_metrics
from .measured_error import Instrument, coast_down_uncertainty, engagement_uncertainty
from .shift import orders_of, stands
from .valve_response import valve_delay

if TYPE_CHECKING:
    from ..bags import Bag
    from .gathered import Gathered

MOTOR = "/motor/command"
FIELDS = {CONTROLLER_COMMAND: ["duty", "setpoint"], MOTOR: ["enable"]}  # what is read of them
BEFORE = 0.5  # s before the order from which rest and hum of the pressure are determined


def measured(recording: Recording, instruments: dict[str, Instrument], bag: Bag | Gathered | None = None) -> dict:
    """Return what a run without a change between gears measured.

    Parameters
    ----------
    recording : Recording
        The logger's channels.
    instruments : dict of str to Instrument
        Instruments of the rig by signal.
    bag : Bag or Gathered, optional
        The recording's bag with the commands to valves and motor; without it there is neither a valve's response nor a
        coast-down.

    Returns
    -------
    dict
        ``valve_responses`` and ``engagements`` (rows, each with ``why`` something was not found) and ``coast_down``, which is
        None when the drive was not switched off with both clutches open.
    """
    responses = (
        []
        if bag is None
        else [
            _response(bag, recording, order)
            for order in recording.orders
            if order[2] in recording.transmission.ratios and stands(recording, order[0])
        ]
    )
    engagements = [engagement_metrics(recording, order, instruments, end) for order, end in orders_of(recording) if order[1] == 0]
    for row in engagements:
        row["errors"] = engagement_uncertainty(row, instruments, recording.transmission) if row["input_speed_before"] else {}
    return {
        "valve_responses": responses,
        "engagements": engagements,
        "coast_down": None if bag is None else _coast_down(bag, recording, instruments),
    }


def measured_lines(found: dict, box: Transmission) -> list[str]:
    """Return the lines for the terminal, in ms, Nm, MPa and rpm."""
    lines = []
    for row in found["valve_responses"]:
        gear, t, clutches = row["gear"], row["t_order_s"], box.engaged(row["gear"])
        pressures, valves = (
            " and ".join(names) for names in ([clutch.pressure for clutch in clutches], [clutch.valve_name for clutch in clutches])
        )
        what = f"gear {box.names[gear]} laid in at {t:.2f} s while the input stood still, which is no shift: "
        lines.append(
            what
            + (
                f"{pressures} rose {row['valve_delay_s'] * 1e3:.0f} ms after the first pulse on {valves}"
                if not row["why"]
                else f"no response of {valves}: {'; '.join(row['why'])}"
            )
        )
    for row in found["engagements"]:
        parts = [
            f"{text} {_with_error(row, key, factor, digits)} {unit}"
            for text, key, factor, digits, unit in (
                ("engaged in", "engagement_s", 1e3, 0, "ms"),
                (f"peak {box.input.torque}", "engagement_peak_nm", 1.0, 1, "Nm"),
                ("kiss pressure", "p_kiss", 1e-6, 2, "MPa"),
                ("hold phase", "hold_s", 1e3, 0, "ms"),
            )
            if row[key] is not None
        ]
        clutches = " and ".join(clutch.name for clutch in box.engaged(row["gear"]))
        lines.append(f"engagement of {clutches} at {row['t_order_s']:.2f} s: {', '.join([*parts, *row['why']])}")
    row = found["coast_down"]
    if row is not None and row["why"]:
        lines.append(f"no coast-down: {'; '.join(row['why'])}")
    elif row is not None:
        lines.append(
            f"coast-down from {row['w_start'] * RPM:.0f} rpm: inertia of the driving side "
            f"{_with_error(row, 'inertia', 1.0, 3)} kg m2 ({row['inertia_half']:.3f} from the upper half of the speed), "
            f"{box.input.torque} {_with_error(row, 'coast_down_torque_nm', 1.0, 2)} Nm before, "
            f"tangent time {_with_error(row, 'coast_down_tangent_s', 1.0, 3)} s"
        )
    return lines


def _with_error(row: dict, key: str, factor: float, digits: int) -> str:
    value, error = in_unit(row[key], row["errors"].get(key), factor)
    return shown(value, error, digits) + ("" if error is None else f" +- {error:.{digits}f}")


def _response(bag: Bag | Gathered, recording: Recording, order: tuple[float, int, int]) -> dict:
    """Return the row of a valve whose clutch was closed at standstill."""
    t_order, _, gear = order
    row = {"gear": int(gear), "t_order_s": float(t_order), "valve_delay_s": None, "t_pulse_s": None, "t_rise_s": None, "why": []}
    try:
        clutch, *others = recording.transmission.engaged(gear)
        if others:
            raise RigError("the gear engages several clutches, and this is about one valve")
        t, (duty, setpoint) = bag.fields(CONTROLLER_COMMAND, FIELDS[CONTROLLER_COMMAND])
        on_coil = duty[:, clutch.output]
        coil = on_coil if on_coil.any() else setpoint[:, clutch.output]  # with a constant current no duty is sent
        on = t[(t >= t_order) & (coil > 0.0)]
        if not on.size:
            raise RigError("its coil got no pulse")
        times = recording.t0 + recording.period * np.arange(recording.rows)
        later = [other[0] for other in recording.orders if other[0] > t_order]
        part = (times >= t_order - BEFORE) & (times < min(later, default=np.inf))
        pulses = 1.0 * (times[part] >= on[0] + SAMPLE)
        found = valve_delay(times[part], pulses, recording.channels[clutch.pressure][part])
        row |= {key: found[key] for key in ("valve_delay_s", "t_pulse_s", "t_rise_s")}
    except RigError as error:
        row["why"].append(str(error))
    return row


def _coast_down(bag: Bag | Gathered, recording: Recording, instruments: dict[str, Instrument]) -> dict | None:
    try:
        t, (enable,) = bag.fields(MOTOR, FIELDS[MOTOR])
    except RigError:
        return None  # the motor was never commanded
    if not t.size or enable[-1]:
        return None
    times = recording.t0 + recording.period * np.arange(recording.rows)
    box = recording.transmission
    w, after = recording.channels[box.input.speed], times >= t[-1]
    pressed = any(
        np.median(recording.channels[clutch.pressure][after]) > clutch.kiss_pressure for clutch in box.clutches if after.any()
    )
    if not after.any() or pressed or w[after][0] < STANDSTILL:
        return None
    try:
        found = coast_down(times, w, recording.channels[box.input.torque])
    except RigError as error:
        return {"why": [str(error)]}
    return {**found, "errors": coast_down_uncertainty(found, instruments), "why": []}
