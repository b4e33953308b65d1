# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of a run as text for the terminal, and the names of its shifts wherever one is named.

`rig run`, `rig simulate` and `rig report` print it. The optional comparisons (Annex A, plant states) are formatted by
analysis.comparison.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..bags import example_of_orders
from ..base import printable
from ..rig import CONTROLLER_EVENTS, Transmission
from .comparison import annex_lines, truth_lines
from .definitions import NO_SEQUENCE, RPM, undefined_lines
from .display import aligned
from .energy import clutch_heat
from .faults import fault_lines, never_begun
from .loops import loops_text
from .metrics import COURSE, Metric, named_metrics
from .no_change import measured_lines
from .quality import sentence_of
from .ranges import range_cells
from .run_report import RUN_KEYS, shown_transmission, verdicts_in, window_of
from .state_at_order import begun_lines
from .trips import trip_lines, without_trips

WHERE_DEFINED = (
    "what the symbols mean: docs/reference/glossary.md; valid and quality: docs/how_to/report.md, section Quality of a shift"
)


def format_report(report: dict) -> str:
    """Return the report as a table in rpm, Nm, ms and J with one line each on losses, lateness, energy and the end.

    The largest error of each metric follows under each shift after "+-". Annex A and the plant's states follow when the
    report holds them.
    """
    head = [f"trips: {off}"] if (off := without_trips(report["run"])) else []
    if "bench" in report:
        from .press_bench import bench_lines

        lines = bench_lines(report["bench"]) or aligned(range_cells(report.get("signals", [])), 2)
        return _shown([*head, *lines, "", *_run_lines(report["run"])])
    box = shown_transmission(report)
    rows, verdicts = report["shifts"], verdicts_in(report)
    errors = report.get("uncertainty") or [{} for _ in rows]
    lines = _shift_tables(rows, errors, verdicts, box) if rows else [no_shift(report)]
    names = [shift_name(number, row, box) for number, row in enumerate(rows, 1)]
    for name, row, verdict in zip(names, rows, verdicts):
        lines += [f"  {name}, is {sentence}"] if (sentence := sentence_of(verdict)) else []
        lines += [f"  {name}, is not valid: {reason}" for reason in row["why"]]
    lines += [f"  {line}" for line in undefined_lines(names, rows, named_metrics(), box)]
    lines += [f"  {line}" for line in begun_lines(names, rows, errors, box)]
    lines += [WHERE_DEFINED] if rows else []
    lines += measured_lines(report["measured"], box) if "measured" in report else []
    if "annex_a" in report:
        lines += ["", *annex_lines(names, rows, errors, report["annex_a"], box)]
    if "truth" in report:
        lines += ["", *truth_lines(names, rows, errors, report["truth"], box)]
    return _shown([*head, *lines, "", *_energy_lines(report, box), *_basis_lines(report), *_run_lines(report["run"])])


def _shown(lines: list[str]) -> str:
    """Return each text as one line, whatever characters of a bag it contains."""
    return "\n".join(map(printable, lines))


def no_shift(report: dict) -> str:
    """Return the sentence that replaces the table when a run has no row for it."""
    run = report["run"]
    if run.get("imported"):
        return (
            "no shift: the orders of gears are not given; import the file with --orders, in Python orders=, e.g. "
            f"'{example_of_orders(shown_transmission(report))}', or with a column of the ordered gear; 'rig compare' takes the "
            "orders of another run"
        )
    if "measured" not in report:
        return "no shifts: there is nothing to look for them in"  # the report's problems give the reason
    if CONTROLLER_EVENTS in _numbers(run.get("left_out")):
        return "no shift: the orders of gears were not recorded; topics left out by the recorder's options are counted below"
    named = run.get("sequence") not in (None, "", NO_SEQUENCE) and run.get("description")
    what = f"{run['sequence']} ({run['description']})" if named else "this run"
    return f"no shift: {what} changes no gear while the input shaft turns"


def shift_name(number: int, row: Mapping, box: Transmission, arrow: str = " -> ") -> str:
    """Return what a shift is called wherever one is named, e.g. ``shift 1, I -> II at 3.85 s``, with the values of its loops.

    Parameters
    ----------
    number : int
        Its place among the shifts of the run's report, from 1, which is its number in every table and view.
    row : mapping
        Its metrics.
    box : Transmission
        The transmission.
    arrow : str
        What stands between its gears.
    """
    return f"shift {number}, {box.way(row['from_gear'], row['to_gear'], arrow)} at {row['t_order_s']:.2f} s{loops_text(row)}"


def numbered_way(number: int, row: Mapping, box: Transmission, arrow: str = " -> ") -> str:
    """Return number, gears and loops of a shift for a table's head or first column, e.g. ``1: I -> II, load 80 Nm``."""
    return f"{number}: {box.way(row['from_gear'], row['to_gear'], arrow)}{loops_text(row)}"


def _shift_tables(rows: list[dict], errors: list[dict], verdicts: list[dict | None], box: Transmission) -> list[str]:
    """Return the metrics of the definitions with the verdicts, then those of the course from order to settled torque."""
    ends = [["valid", "quality"]]
    ends += [["yes" if row["valid"] else "NO", (verdict or {}).get("grade") or "-"] for row, verdict in zip(rows, verdicts)]
    course = named_metrics(COURSE)
    tables = [_shift_table(rows, errors, [one for one in named_metrics() if one not in course], ends, "shift", box)]
    if any(row.get("input_torque_high_nm") is not None for row in rows):
        tables.append(_shift_table(rows, errors, course, [[]] * len(ends), "from order to settled", box))
    return [line for table in tables for line in table]


def _shift_table(
    rows: list[dict], errors: list[dict], columns: Sequence[Metric], ends: list[list[str]], title: str, box: Transmission
) -> list[str]:
    """Return a row for each shift, and one with its errors; ``ends`` has the head and the cells of the last columns."""
    table = [[title, *(one.heading(box) for one in columns), *ends[0]]]
    for i, row in enumerate(rows):
        own = errors[i]
        table.append([numbered_way(i + 1, row, box), *(one.cell(row, own) for one in columns), *ends[i + 1]])
        if own:
            found = [f"{own[one.key] * one.factor:.{one.digits}f}" if one.key in own else "" for one in columns]
            table.append(["  +-", *found, *[""] * len(ends[0])])
    return aligned(table)


def _energy_lines(report: dict, box: Transmission) -> list[str]:
    lines = []
    for number, (row, account) in enumerate(zip(report["shifts"], report["energy"]["shifts"]), 1):
        name = f"shift {number}, {box.way(row['from_gear'], row['to_gear'])}"
        if account is None:
            if window_of(row) is None and report["energy"]["run"] is not None:
                lines.append(f"energy of {name}: -, as no end of the shift was found")
            continue
        heat = clutch_heat(account, box)
        share = account["residual_of_heat"]
        share = "no clutch heat" if share is None else f"{100.0 * share:+z.2f} % of it"
        name += "" if row["valid"] else " (not valid)"
        lines.append(f"energy of {name}: clutch heat {heat:z.0f} J, unaccounted {account['residual_j']:+z.2f} J ({share})")
    if lines and (note := not_accounted(report["run"])):
        lines.append(f"  {note}")
    return lines


def _basis_lines(report: dict) -> list[str]:
    basis = report.get("basis")
    if basis is None or not (report["shifts"] or any(report.get("measured", {}).values())):
        return []  # no result was computed
    errors = basis["largest_errors"]
    ratios = " and ".join(f"{ratio:.4f}" for ratio in basis["ratios"].values())
    origin = ", as the bag does not name its own" if basis.get("taken") else f", {basis['named_by']}" if "named_by" in basis else ""
    pressures = " and ".join(f"{error / 1e6:.3g}" for name, error in errors.items() if name not in ("torque", "speed"))
    return [
        f"computed with inertias ({basis['inertia_driving']:g} and {basis['inertia_driven']:g} kg m2) and instrument errors "
        f"({errors['torque']:.3g} Nm, {errors['speed'] * RPM:.2g} rpm, {pressures} MPa) of rig "
        f"'{basis['rig']}'{origin}, ratios {ratios}"
    ]


def not_accounted(run: Mapping) -> str:
    """Return what of a run's energy is not accounted, in words; empty where all of it is."""
    prescribed = (run.get("configuration") or {}).get("prescribed") or {}
    bounded = prescribed.get("output_speed") == "bounded"
    return "output_speed is bounded: the speed is set between the gears' and not by a torque, which is not accounted" * bounded


def _numbers(value: object) -> dict[str, float]:
    """Return the numbers of an object in a report; none of what is no such object, as in a report that others have written."""
    held = value.items() if isinstance(value, dict) else ()
    return {name: number for name, number in held if isinstance(number, (int, float))}


def _run_lines(run: dict) -> list[str]:
    if all(run[key] is None for key in RUN_KEYS):
        return [f"problem: {problem}" for problem in run.get("problems", [])]  # a logger's file, which is not a run of the rig
    begun = _numbers(run).get("recorded_from_s")
    since = f" (recorded from {begun:.3f} s on)" if begun else ""
    injected, ordered = run.get("faults") or (), (run.get("configuration") or {}).get("faults") or ()
    lines = fault_lines(injected) + trip_lines(run)
    if "recorded_from_s" not in run:
        lines += never_begun(injected, ordered)
    lines += [f"messages lost: {'unknown' if run['lost'] is None else run['lost']}{since}"]
    if left_out := _numbers(run.get("left_out")):
        lines.append(f"left out by the recorder's options: {sum(left_out.values())} messages of {len(left_out)} topics")
    if late := _numbers(run["lateness_ms"]):
        names = {"p50": "median", "p99": "p99", "max": "max"}
        shown = ", ".join(f"{names[key]} {late[key]:.2f}" for key in names if key in late)
        ticks = f"{run['overruns']} of {run['ticks']} ticks more than one tick late"
        lines.append(f"lateness of ticks: {shown} ms; {ticks}")
    end = run["end"]
    reason = end.get("reason") if isinstance(end, dict) else end
    lines.append(f"end: {reason or 'unknown'}")
    if run.get("recovered"):
        lines.append(f"bag: damaged; {run['recovered']}")
    return lines + [f"problem: {problem}" for problem in run.get("problems", [])]
