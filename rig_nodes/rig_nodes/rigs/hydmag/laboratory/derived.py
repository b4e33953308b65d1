# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Quantities of targets.yaml that need more than one series: ranks, extremes, and the delay from which shifts dip.

Used by rigs.hydmag.laboratory.programme on the averaged records of everything that ran.
"""

from __future__ import annotations

import itertools

from rig_nodes.analysis import HOLD_SHORTEST, engagement_ranks

from .records import ASPECTS, Record, canonical, group

NO_DIP = 0.95  # k, Annex A and 7.4.2.3
TORQUE_ALIKE, TIME_ALIKE = 1.01, 0.01  # Nm, s: two values that differ by less count as equal (7.1, 9.2.2)


def derive(records: list[Record]) -> list[Record]:
    """Return the derived records; the given ones are not changed."""
    measured = _measured(records)
    compared = [*records, *measured]
    return [
        *_holds(records),
        *_ranks(records),
        *_dips(records),
        *_delays(records),
        *measured,
        *gaps(compared),
        *peak_gaps(compared),
    ]


def _whole(records: list[Record], procedure: str, quantity: str, **conditions: float | str) -> list[Record]:
    """Return the records of whole tests whose value for a quantity is a number or None."""
    return [
        r
        for r in records
        if r.procedure == procedure
        and quantity in r.values
        and not {*ASPECTS} & set(r.conditions)
        and not isinstance(r.values[quantity], str)
        and all(r.conditions.get(name) == value for name, value in conditions.items())
    ]


def _holds(records: list[Record]) -> list[Record]:
    """Return hold, and the phases of the rise, of each profile series, by the mean length of the level stretch."""
    out = []
    for r in _whole(records, "profile_series", "level_s"):
        level = r.values["level_s"]
        words = (None, None) if level is None else ("hold", "three phases") if level >= HOLD_SHORTEST else ("no hold", "no hold")
        out += [
            Record("profile_series", r.conditions, {name: word}, {} if word else {name: r.why["level_s"]})
            for name, word in zip(("hold", "pressure_rise"), words)
        ]
    return out


def _ranks(records: list[Record]) -> list[Record]:
    """Return the engagement_rank of each profile series among those of its valve; one without a hold phase has no rank (7.3.2)."""
    out = []
    for _, series in group(_whole(records, "profile_series", "engagement_peak_nm"), ("valve",)):
        rows = []
        for r in series:
            level = r.values["level_s"]
            rows.append({**r.values, "hold_s": 0.0 if level is not None and level < HOLD_SHORTEST else level})
        for record, row, rank in zip(series, rows, engagement_ranks(rows)):
            why = {} if rank else {"engagement_rank": "peak, time or hold of this series was not found"}
            rank = "no hold" if rank and not row["hold_s"] else rank
            out.append(Record("profile_series", record.conditions, {"engagement_rank": rank}, why))
    return out


def _dips(records: list[Record]) -> list[Record]:
    """Return the class of dip of every shift, by the mean of its repeats."""
    out = []
    for name in ("delay_series", "grid_up", "grid_down"):
        for r in _whole(records, name, "k"):
            k = r.values["k"]
            out.append(
                Record(
                    name,
                    r.conditions,
                    {"dip": None if k is None else "dip" if k < NO_DIP else "no dip"},
                    {"dip": r.why["k"]} if k is None and "k" in r.why else {},
                )
            )
    return out


def _delays(records: list[Record]) -> list[Record]:
    """Return which of the 19 series has the smallest upshift peak and the shortest downshift, and where the dip begins."""
    up = [r for r in _whole(records, "delay_series", "input_torque_max_nm", shift="I-II") if "series" in r.conditions]
    down = [r for r in _whole(records, "delay_series", "t_dt_s", shift="II-I") if "series" in r.conditions]
    out = _lowest(up, "input_torque_max_nm", TORQUE_ALIKE, "smallest", "not smallest")
    out += _lowest(down, "t_dt_s", TIME_ALIKE, "shortest", "not shortest")
    if up:
        begins, why = dip_begins(up)
        together = {name: up[0].conditions[name] for name in ("shift", "n_wej", "m_wyj")}
        out.append(
            Record(
                "delay_series",
                {**together, "series": "all"},
                {"dip_begins_s": begins},
                {} if begins is not None else {"dip_begins_s": why},
            )
        )
    return out


def _lowest(series: list[Record], quantity: str, alike: float, yes: str, no: str) -> list[Record]:
    found = [value for r in series if (value := r.values[quantity]) is not None]
    out = []
    for r in series:
        value = r.values[quantity]
        word = None if value is None else yes if value - min(found) <= alike else no
        out.append(
            Record("delay_series", r.conditions, {quantity: word}, {} if word else {quantity: r.why.get(quantity, "was not found")})
        )
    return out


def dip_begins(series: list[Record]) -> tuple[float | None, str]:
    """Return the t12 above which every series dips.

    That is where k over t12 (the mean of equal delays) crosses 0.95 for the last time, on a straight line between two delays.

    Parameters
    ----------
    series : list of Record
        Upshifts with their t12 and k.

    Returns
    -------
    t12 : float or None
        The delay [s]; None where k does not cross 0.95.
    why : str
        The reason when there is none.
    """
    points = []
    for key, same in group(series, ("t12",)):
        values = [r.values["k"] for r in same]
        if None in values:
            return None, f"k was not found at t12 = {key['t12'] * 1e3:g} ms"
        points.append((key["t12"], sum(values) / len(values)))
    points.sort()
    if points[-1][1] >= NO_DIP:
        return None, f"no dip at the highest t12, {points[-1][0] * 1e3:g} ms"
    for (t_low, k_low), (t_high, k_high) in reversed(list(itertools.pairwise(points))):
        if k_low >= NO_DIP:
            return t_low + (t_high - t_low) * (k_low - NO_DIP) / (k_low - k_high), ""
    return None, f"every series dips, down to t12 = {points[0][0] * 1e3:g} ms"


def _measured(records: list[Record]) -> list[Record]:
    """Return the grids once more as the measurements of chapter 9's comparison, in which the rig stands for the laboratory."""
    return [
        Record(
            "chapter9",
            {**r.conditions, "source": "measured"},
            {key: r.values[key] for key in ("input_torque_max_nm", "t_p_s")},
            r.why,
        )
        for name in ("grid_up", "grid_down")
        for r in _whole(records, name, "t_p_s")
    ]


def gaps(records: list[Record]) -> list[Record]:
    """Return for each input speed where over the load the simulated and the measured t_p21 of chapter 9 differ most.

    The class is "largest at both ends" when the largest difference of the lower half of the loads stands at the lowest load and
    that of the upper half at the highest load; otherwise it is "not so".

    Parameters
    ----------
    records : list of Record
        Shifts of chapter 9 with their source.

    Returns
    -------
    list of Record
        One record for each input speed at which both were shifted at four loads or more.
    """
    times: dict[str, dict] = {"simulated": {}, "measured": {}}
    for r in _whole(records, "chapter9", "t_p_s", shift="II-I"):
        at = canonical(r.conditions["n_wej"]), canonical(r.conditions["m_wyj"])
        times[str(r.conditions["source"])][at] = (r, r.values["t_p_s"])
    lines: dict[float | str, list[tuple[Record, float | None]]] = {}
    for at in sorted(set(times["simulated"]) & set(times["measured"])):
        (record, one), (_, other) = times["simulated"][at], times["measured"][at]
        lines.setdefault(at[0], []).append((record, None if one is None or other is None else abs(one - other)))
    out = []
    for points in lines.values():
        if len(points) < 4:
            continue
        conditions = {name: points[0][0].conditions[name] for name in ("shift", "n_wej")}
        known = [gap for _, gap in points if gap is not None]
        if len(known) < len(points):
            out.append(Record("chapter9", conditions, {"t_p_gap": None}, {"t_p_gap": "t_p21 was not found at every load"}))
            continue
        half = len(known) // 2
        ends = known[0] > max(known[1:half]) and known[-1] > max(known[-half:-1])
        out.append(Record("chapter9", conditions, {"t_p_gap": "largest at both ends" if ends else "not so"}))
    return out


def peak_gaps(records: list[Record]) -> list[Record]:
    """Return how far the measured peak of M_wej lies above the simulated one, for each downshift of chapter 9 that has both.

    Parameters
    ----------
    records : list of Record
        Shifts of chapter 9 with their source.

    Returns
    -------
    list of Record
        One record for each input speed and load, with peak_gap_nm [Nm].
    """
    peaks: dict[tuple, dict[str, Record]] = {}
    for r in _whole(records, "chapter9", "input_torque_max_nm", shift="II-I"):
        at = canonical(r.conditions["n_wej"]), canonical(r.conditions["m_wyj"])
        peaks.setdefault(at, {})[str(r.conditions["source"])] = r
    out = []
    for both in peaks.values():
        if len(both) < 2:
            continue
        one, other = (both[source].values["input_torque_max_nm"] for source in ("measured", "simulated"))
        conditions = {name: both["measured"].conditions[name] for name in ("shift", "n_wej", "m_wyj")}
        known = one is not None and other is not None
        why = {} if known else {"peak_gap_nm": "the peak of M_wej was not found"}
        out.append(Record("chapter9", conditions, {"peak_gap_nm": one - other if known else None}, why))
    return out
