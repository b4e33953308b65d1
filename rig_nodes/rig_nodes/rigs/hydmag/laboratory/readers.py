# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The step from a recorded run to records, with one function for each procedure of the gearbox rig.

Used by rigs.hydmag.laboratory.programme. Each function takes a series' conditions and its Run and returns a list of repeats, each a
list of records, or raises RigError with the reason why there are none. Quantities derived from one shift are computed here.
"""

from __future__ import annotations

from functools import cache
from math import pi
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.analysis import (
    PRESSURE_MEAN,
    TORQUE_SPEED_MEAN,
    Instrument,
    engagement_metrics,
    first_true,
    instruments_of,
    odd_width,
    ramp_start,
    running_mean,
    shifts,
    valve_delay,
)
from rig_nodes.analysis import coast_down as fit_coast_down
from rig_nodes.bags import Recording
from rig_nodes.base import SAMPLE, RigError
from rig_nodes.rig import Clutch, Transmission, load_rig

from .records import Record

if TYPE_CHECKING:
    from rig_nodes.runs import Run

SHIFT_KEYS = ("t_dt_s", "t_p_s", "t_c_s", "t_o_s", "input_torque_max_nm", "k", "e_loss_j", "e_loss_settled_j")
SHIFT_VALUES = (*SHIFT_KEYS, "output_speed_min_rpm", "e_loss_release_j", "speed_delay_s", "peak_share")
STEADY_AFTER, STEADY_FOR = 0.5, 0.1  # s after M_wej has settled; s over which Annex A averages the settled torque
TRACE_STEP, TRACE = 2e-3, 0.6  # s; the curves of Annex D end by then, except the falling p2
LONG_TRACE = 1.0  # s, for the falling p2
SPEED_STEP = 50e-3  # s between the values of a coast-down, each a mean over SPEED_MEAN
SPEED_MEAN = 20e-3
ENGAGEMENT = {
    "input_torque_mean_nm": "input_torque_mean_nm",
    "p_kiss_mpa": "p_kiss",
    "engagement_s": "engagement_s",
    "engagement_peak_nm": "engagement_peak_nm",
    "level_s": "level_s",
}
DISTURBANCE = "disturbance_span_s"
PEAK_EVENT = "peak_event"
ENCODER_ERROR = pi / 30.0  # rad/s: 1 rpm, tab. 7.1


class NotMeasured(RigError):
    """A run did not show what its procedure is for; the sentence becomes the reason of every missing value."""


def failed(procedure: str, conditions: dict, reason: str) -> list[Record]:
    """Return the records of a series that could not be measured: every value is None, with the reason.

    Parameters
    ----------
    procedure : str
        Name of the procedure.
    conditions : dict
        Conditions of the series [SI].
    reason : str
        Why it could not be measured.

    Returns
    -------
    list of Record
        The records.
    """
    values = {
        "valve_response": ("valve_delay_s",),
        "coast_down": ("coast_down_tangent_s", "coast_down_torque_nm"),
        "profile_series": (*ENGAGEMENT, DISTURBANCE),
        "clutch_bench": ("m_eks", "k_kor", "k_kor_error", "m_rest_nm"),
        "spring_bench": ("spring_force_n", "cylinder_force_n", "cylinder_start_mpa"),
    }.get(procedure, SHIFT_VALUES)
    places = [conditions]
    if procedure == "delay_series":
        places = [{**conditions, "shift": shift} for shift in laboratory()[0].ways()]
    records = [Record(procedure, place, dict.fromkeys(values), dict.fromkeys(values, reason)) for place in places]
    if procedure == "coast_down":
        records.append(Record(procedure, {"side": "driving"}, {"inertia": None}, {"inertia": reason}))
    return records


@cache
def laboratory() -> tuple[Transmission, dict[str, Instrument]]:
    """Return the transmission of the laboratory's rig and its instruments."""
    config = load_rig("hydmag")
    return config.transmission, instruments_of(config.as_dict())


# --- shifts ---------------------------------------------------------------------------------------


def delay_series(conditions: dict, run: Run) -> list[list[Record]]:
    """Return the shifts of a run of the delay series; each I-II with a II-I is a repeat of its own.

    Parameters
    ----------
    conditions : dict
        Conditions of the series [SI].
    run : Run
        The recorded run.

    Returns
    -------
    list of list of Record
        Repeats of records.

    Raises
    ------
    NotMeasured
        When a shift did not take place.
    """
    found = {
        shift: [_shift(conditions, "delay_series", shift, row) for row in _rows(run.recording, shift)]
        for shift in run.recording.transmission.ways()
    }
    up, down = found
    for record, row in zip(found[down], _rows(run.recording, down)):
        record += _rise_class("delay_series", record[0].conditions, run.recording, row)
    count = min(map(len, found.values()))
    if not count:
        raise NotMeasured(f"the shifts {up} and {down} did not take place")
    return [found[up][i] + found[down][i] for i in range(count)]


def grid_up(conditions: dict, run: Run) -> list[list[Record]]:
    """Return the records of the upshifts, with pressures over time and torques before, during and after.

    Raises
    ------
    NotMeasured
        When there was no upshift.
    """
    return _grid("grid_up", conditions, run)


def grid_down(conditions: dict, run: Run) -> list[list[Record]]:
    """Return the records of the downshifts, with the same quantities as :func:`grid_up`.

    Raises
    ------
    NotMeasured
        When there was no downshift.
    """
    return _grid("grid_down", conditions, run)


def chapter9(conditions: dict, run: Run) -> list[list[Record]]:
    """Return the records of the shifts of the thesis's own simulation, whose pressures are prescribed.

    Raises
    ------
    NotMeasured
        When there was no shift.
    """
    rows = _rows(run.recording, conditions["shift"])
    if not rows:
        raise NotMeasured(f"the shift {conditions['shift']} did not take place")
    return [_shift(conditions, "chapter9", conditions["shift"], row) for row in rows]


def _grid(procedure: str, conditions: dict, run: Run) -> list[list[Record]]:
    shift = conditions["shift"]
    rows = _rows(run.recording, shift)
    if not rows:
        raise NotMeasured(f"the shift {shift} did not take place")
    repeats = []
    for row in rows:
        records = _shift(conditions, procedure, shift, row)
        records += _torques(procedure, conditions, run.recording, row)
        records.append(peak_event(procedure, conditions, run.recording, row))
        if conditions["m_wyj"] > 0.0:  # the laboratory's curves are of loaded shifts
            records += [
                trace
                for clutch in run.recording.transmission.clutches
                for trace in _trace(procedure, conditions, run.recording, row, clutch)
            ]
        repeats.append(records)
    return repeats


def _rows(recording: Recording, shift: str) -> list[dict]:
    gears = recording.transmission.ways()[shift]
    return [row for row in shifts(recording) if (row["from_gear"], row["to_gear"]) == gears]


def _shift(conditions: dict, procedure: str, shift: str, row: dict) -> list[Record]:
    values = {key: row[key] for key in SHIFT_KEYS}
    lowest = row["output_speed_min_rpm"]
    values["output_speed_min_rpm"] = None if lowest is None else lowest * pi / 30.0
    values["e_loss_release_j"] = _less(row["e_loss_settled_j"], row["e_loss_j"])
    values["speed_delay_s"] = _less(row["t_dt_s"], row["t_p_s"])
    load, peak = conditions["m_wyj"], row["input_torque_max_nm"]
    values["peak_share"] = None if peak is None or load <= 0.0 else peak / load
    reason = "; ".join(row["why"]) or "was not found"
    why = {name: reason for name, value in values.items() if value is None}
    return [Record(procedure, {**conditions, "shift": shift}, values, why)]


def _less(one: float | None, other: float | None) -> float | None:
    return None if one is None or other is None else one - other


def _torques(procedure: str, conditions: dict, recording: Recording, row: dict) -> list[Record]:
    """Return input_torque_max_nm of the shift, and the larger of the steady torques before and after it (phase "before")."""
    steady, torque = None, recording.transmission.input.torque
    if row["t_c_s"] is not None and row["t_o_s"] is not None:
        after = row["t_order_s"] + row["t_c_s"] + row["t_o_s"] + STEADY_AFTER
        means = [_mean(recording, torque, row["t_order_s"] - STEADY_FOR), _mean(recording, torque, after)]
        known = [mean for mean in means if mean is not None]
        steady = max(known) if len(known) == len(means) else None
    why = {"input_torque_max_nm": "; ".join(row["why"]) or f"{torque} was not recorded long enough after the shift"}
    return [
        Record(procedure, {**conditions, "phase": phase}, {"input_torque_max_nm": value}, {} if value is not None else why)
        for phase, value in (("shift", row["input_torque_max_nm"]), ("before", steady))
    ]


def peak_event(procedure: str, conditions: dict, recording: Recording, row: dict) -> Record:
    """Return whether the output is slower than in the new gear, by more than the encoder's error, when M_wej is highest.

    As in Annex A, whose peaks 7.4.2.2 speaks of: from the start of t_dtr to the end of t_o, by means over 2 ms, and the speed of
    the gear is that at the input's speed before the order, as in k_r (7.4).

    Parameters
    ----------
    procedure : str
        Name of the procedure.
    conditions : dict
        Conditions of the series [SI].
    recording : Recording
        The recorded run.
    row : dict
        Metrics of the shift.

    Returns
    -------
    Record
        The class peak_event.
    """
    if row["t_c_s"] is None or row["t_dt_s"] is None or row["t_o_s"] is None:
        return Record(procedure, conditions, {PEAK_EVENT: None}, {PEAK_EVENT: "; ".join(row["why"]) or "was not found"})
    box, end = recording.transmission, row["t_order_s"] + row["t_c_s"]
    first, last = (int(round((at - recording.t0) / recording.period)) for at in (end - row["t_dt_s"], end + row["t_o_s"]))
    width = odd_width(TORQUE_SPEED_MEAN, recording.period)
    torque, out = (running_mean(recording.channels[name], width)[first : last + 1] for name in (box.input.torque, box.output.speed))
    below = row["input_speed_rpm"] * pi / 30.0 / box.ratios[row["to_gear"]] - out[int(np.argmax(torque))] > ENCODER_ERROR
    return Record(procedure, conditions, {PEAK_EVENT: "below the speed of gear I" if below else "not below it"})


def _mean(recording: Recording, name: str, since: float) -> float | None:
    first = int(round((since - recording.t0) / recording.period))
    part = recording.channels[name][max(first, 0) : first + int(round(STEADY_FOR / recording.period))]
    return float(np.mean(part)) if len(part) >= 0.9 * STEADY_FOR / recording.period else None


def _trace(procedure: str, conditions: dict, recording: Recording, row: dict, clutch: Clutch) -> list[Record]:
    """Return the pressure of one clutch over the time since its own fall or rise began."""
    name, quantity = clutch.pressure, f"{clutch.pressure}_mpa"
    falling = clutch in recording.transmission.shift(row["from_gear"], row["to_gear"]).releasing
    smooth = running_mean(recording.channels[name], odd_width(PRESSURE_MEAN, recording.period))
    if falling:
        start = None if row["t_dt_s"] is None else row["t_order_s"] + row["t_c_s"] - row["t_dt_s"]
        why = "; ".join(row["why"])
    else:
        start = rise_start(recording, smooth, clutch, row["t_order_s"])
        why = f"{name} did not rise"
    if start is None:
        return [Record(procedure, {**conditions, "time": 0.0}, {quantity: None}, {quantity: why})]
    # the curve of p2 falling ends later than the others
    last = LONG_TRACE if falling and row["to_gear"] < row["from_gear"] else TRACE
    times = np.arange(0.0, last + 0.5 * TRACE_STEP, TRACE_STEP)
    rows = np.rint((start + times - recording.t0) / recording.period).astype(int)
    return [
        Record(procedure, {**conditions, "time": round(float(t), 6)}, {quantity: float(smooth[at])})
        for t, at in zip(times, rows)
        if at < smooth.size
    ]


def rise_start(recording: Recording, smooth: np.ndarray, clutch: Clutch, t_order: float) -> float | None:
    """Return when the pressure of an engaging clutch begins to rise after an order.

    As for the fall in analysis.metrics, this is the last passing of a level just above the rest before the kiss pressure is
    reached, followed back along its slope.

    Parameters
    ----------
    recording : Recording
        The recording.
    smooth : (n,) array of float
        The clutch's pressure, averaged [Pa].
    clutch : Clutch
        The clutch.
    t_order : float
        Time of the order [s].

    Returns
    -------
    float or None
        Start of the rise [s]; None when the pressure does not rise.
    """
    order = int(np.ceil((t_order - recording.t0) / recording.period))
    before = smooth[max(0, order - 1000) : order]
    rest, noise = float(np.median(before)), float(np.std(before))
    rise = max(clutch.kiss_pressure - rest, 0.1 * clutch.kiss_pressure)
    moved = smooth - rest
    far = first_true(moved >= rise, order)
    if far is None:
        return None
    level = min(max(4.0 * noise, 0.02 * clutch.kiss_pressure), 0.4 * rise)
    below = np.flatnonzero(moved[order:far] < level)
    at = order + (int(below[-1]) + 1 if below.size else 0)
    reach = int(round(20e-3 / recording.period))
    raw = recording.channels[clutch.pressure] - rest
    return recording.t0 + ramp_start(raw, moved, at, 0.1 * rise, reach) * recording.period


def _rise_class(procedure: str, conditions: dict, recording: Recording, row: dict) -> list[Record]:
    """Return whether the pressure of the engaging clutch dips.

    The shape of the rise does not depend on the other clutch, so the order is taken as one from neutral.
    """
    rise = engagement_metrics(recording, (row["t_order_s"], 0, row["to_gear"]), laboratory()[1])
    why = {} if rise["disturbed"] else {"pressure_rise": "; ".join(rise["why"])}
    return [Record(procedure, conditions, {"pressure_rise": rise["disturbed"]}, why)]


# --- single engagements, valves, coast-down -------------------------------------------------------


def profile_series(conditions: dict, run: Run) -> list[list[Record]]:
    """Return the records of the last engagement of the series' clutch from neutral.

    Raises
    ------
    NotMeasured
        When there was no such engagement.
    """
    box, orders = run.recording.transmission, run.recording.orders
    gear = next(gear.number for gear in box.gears if gear.clutches == (conditions["clutch"],))
    ends = [order[0] for order in orders[1:]] + [None]
    found = [(order, end) for order, end in zip(orders, ends) if order[1] == 0 and order[2] == gear]
    rows = [
        row
        for row in (engagement_metrics(run.recording, order, laboratory()[1], end) for order, end in found)
        if row["input_speed_before"] is None or row["input_speed_before"] >= 1.0
    ]
    # the load was set before, with the clutch closed, so the last engagement is the measured one
    if not rows:
        raise NotMeasured("the engagement did not take place")
    return [_engagement(conditions, run.recording, rows[-1])]


def _engagement(conditions: dict, recording: Recording, row: dict) -> list[Record]:
    reason = "; ".join(row["why"]) or "was not found"

    def record(extra: dict, values: dict) -> Record:
        return Record(
            "profile_series", {**conditions, **extra}, values, {name: reason for name, value in values.items() if value is None}
        )

    records = [
        record({}, {**{name: row[key] for name, key in ENGAGEMENT.items()}, DISTURBANCE: _disturbance(row)}),
        record({}, {"pressure_rise": row["disturbed"]}),
        record({"phase": "fill"}, {"pressure_rise": row["growth_fill"]}),
        record({"phase": "after contact"}, {"pressure_rise": row["growth_contact"]}),
    ]
    if row["fill_start_s"] is None:
        return [*records, record({"time": 0.0}, {"pressure_rise": None})]
    (clutch,) = recording.transmission.engaged(row["gear"])
    smooth = running_mean(recording.channels[clutch.pressure], odd_width(PRESSURE_MEAN, recording.period))
    first, last = (
        int(round((row["t_order_s"] + row[key] - recording.t0) / recording.period)) for key in ("fill_start_s", "fill_end_s")
    )
    step = max(1, int(round(SAMPLE / recording.period)))
    return records + [
        record({"time": i * recording.period}, {"pressure_rise": float(smooth[i])}) for i in range(first, last + 1, step)
    ]


def _disturbance(row: dict) -> float | None:
    """Return for how long the rising pressure was disturbed: from its peak until it is back there, and 0 when it did not dip."""
    if row["disturbed"] == "monotone":
        return 0.0
    return _less(row["disturbance_end_s"], row["disturbance_start_s"])


def valve_response(conditions: dict, run: Run) -> list[list[Record]]:
    """Return the record of the delay from coil voltage and pressure.

    Raises
    ------
    NotMeasured
        When the coil voltage was not recorded.
    """
    channels, recording = run.recording.channels, run.recording
    clutch = next(one for one in recording.transmission.clutches if one.valve_name == conditions["valve"])
    coil = clutch.voltage
    if coil not in channels:
        raise NotMeasured(f"the recording has no coil voltage {coil}, only the mean of its pulses")
    t = recording.t0 + recording.period * np.arange(recording.rows)
    delay = valve_delay(t, channels[coil], channels[clutch.pressure])["valve_delay_s"]
    return [[Record("valve_response", conditions, {"valve_delay_s": delay})]]


def coast_down(conditions: dict, run: Run) -> list[list[Record]]:
    """Return the records of tangent, torque and inertia, and of the speed over the time since the drive was cut off."""
    recording = run.recording
    t = recording.t0 + recording.period * np.arange(recording.rows)
    into = recording.transmission.input
    w = recording.channels[into.speed]
    fit = fit_coast_down(t, w, recording.channels[into.torque])
    records = [
        Record("coast_down", conditions, {key: fit[key] for key in ("coast_down_tangent_s", "coast_down_torque_nm")}),
        Record("coast_down", {"side": "driving"}, {"inertia": fit["inertia"]}),
    ]
    smooth = running_mean(w, odd_width(SPEED_MEAN, recording.period))
    times = np.arange(0.0, t[-1] - fit["t_cut_s"], SPEED_STEP)
    rows = np.rint((fit["t_cut_s"] + times - recording.t0) / recording.period).astype(int)
    records += [
        Record("coast_down", {**conditions, "time": round(float(s), 6)}, {"w_wej": float(smooth[at])}) for s, at in zip(times, rows)
    ]
    return [records]
