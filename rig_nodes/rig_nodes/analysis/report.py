# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of a run: run data, shift metrics with errors, energy balance, as JSON and as a table for the terminal.

`rig run`, `rig simulate` and `rig report` use it. Everything except the run data is computed from the bag. The optional
comparisons (Annex A, plant states) are formatted by analysis.comparison.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..bags import limits
from ..bags.exchange.orders import example_of_orders
from ..bags.logged import Recording, orders_in
from ..bags.messages import NOTHING
from ..bags.reader import UNREADABLE, Bag
from ..bags.rig_record import holds_rig, rig_record
from ..base.atomic_write import atomic_write
from ..base.errors import RigError, printable
from ..rig.configuration import load_rig
from ..rig.structure import End
from ..rig.transmission import Inertias, Transmission, transmission_of
from .annex_a import shifts_annex_a
from .clipped import clipped_in
from .clutch_torques import put_torques
from .comparison import annex_lines, truth_lines
from .definitions import RPM, reasons_in, undefined_lines
from .energy import Series, balance, clutch_heat, energies_of
from .gathered import Gathered
from .metrics import COURSE, Metric, named_metrics
from .no_change import measured, measured_lines
from .plant_states import metrics_of_states, states_of
from .quality import quality_of, sentence_of
from .ranges import range_lines, signal_ranges
from .shift import shifts
from .shown import aligned
from .state_at_order import begun_lines, put_states
from .uncertainty import Instrument, instruments_of, uncertainty

REPORT_FILE = "report.json"
WHERE_DEFINED = (
    "what the symbols mean: docs/reference/glossary.md; valid and quality: docs/how_to/report.md, section Quality of a shift"
)
_NOTHING_SHOWN = Transmission(
    *[End("", "input speed", "input torque"), End("", "output speed", "output torque")], (), (), Inertias(0.0, 0.0)
)
RUN_KEYS = ("configuration", "seed", "versions", "lost", "ticks", "overruns", "lateness_ms", "end")


def build_report(bag: Bag | Gathered, run: dict, annex_a: float | None = None, truth: bool = False) -> dict:
    """Return the report of a bag.

    It is ``{"run", "shifts": [...], "energy": {"run", "shifts": [...]}, "quality": [...], "uncertainty": [...]}``. ``quality``
    holds the verdict on each shift (quality.quality_of), ``uncertainty`` the largest error of each of its metrics; ``basis`` holds
    the inertias, ratios and instruments used, which are those of the bag's configuration. ``run["recorded_from_s"]`` is there for
    a bag that does not hold the start of its run. A run without a change between gears has ``measured`` (no_change.measured). A run
    of a rig without gears has no shifts; its results are under ``"bench"`` (analysis.press_bench) and the range of each signal
    under ``"signals"`` (analysis.ranges).

    The energy of a shift covers the time from its order until its torque has settled, or until lock-up on a rig without t_o; it is
    None when that was not found. When a bag is too damaged or too short for a part, that part is empty (or a shift's energy None)
    and a sentence on it is in ``run["problems"]``. Missing numbers are None, never NaN.

    Parameters
    ----------
    bag : Bag or Gathered
        The bag in memory, or what :func:`analysis.gather.gather` gathered of its pieces, with the same ``annex_a``.
    run : dict
        Facts that only the runner has (:data:`RUN_KEYS`). Absent keys become None; an absent ``lost`` is counted from the gaps
        of an undamaged bag.
    annex_a : float, optional
        Factor of Annex A's torque band; adds ``"annex_a": {"factor": ..., "shifts": [...]}``.
    truth : bool
        True to add ``"truth"``: for each shift the metrics by the plant's states, None when the bag does not hold them.

    Returns
    -------
    dict
        The report.

    Raises
    ------
    RigError
        When the bag's record of its rig is invalid.
    """
    if not bag.began:
        return _assembled(_run_data(bag, run), [NOTHING], {"shifts": [], "uncertainty": []}, {"run": None, "shifts": []})
    problems: list[str] = []
    record, imported = record_of(bag, run), info_of(bag).get("imported")
    if not record["structure"]["gears"]:
        from .press_bench import bench_report

        found = bench_report(bag, record, problems)
        problems += clipped_in(bag, record)
        return _assembled(_run_data(bag, run), problems, {"shifts": [], "uncertainty": []}, {"run": None, "shifts": []}) | {
            "bench": plain(found),
            "signals": plain(bag.ranges.rows() if isinstance(bag, Gathered) else signal_ranges(bag)),
        }
    recording, rows = None, []
    try:
        box, instruments = transmission_of(record), instruments_of(record)
    except UNREADABLE as error:
        raise no_rig(error) from None
    try:
        recording, rows = bag.shifts() if isinstance(bag, Gathered) else _with_shifts(recording_of(bag, box))
    except RigError as error:
        problems.append(f"no shift metrics: {error}")
    problems += clipped_in(bag, record)
    if not imported:
        put_torques(bag, rows, box)
        put_states(bag, record, box, rows)
    gathered = bag if isinstance(bag, Gathered) else None
    metrics = _metrics(recording, rows, instruments, annex_a, problems, None if imported else bag, gathered)
    metrics["basis"] = basis_of(record, box, instruments)
    if isinstance(imported, dict):
        metrics["basis"]["named_by"] = f"named by {imported.get('rig_named_by')} for the file {imported.get('file')}"
    if not holds_rig(run.get("configuration") or info_of(bag).get("configuration")):
        metrics["basis"]["taken"] = True
    energy: dict[str, Any] = {"run": None, "shifts": [None] * len(rows)}
    if imported:
        return _assembled(_run_data(bag, run), problems, metrics, energy)  # a measurement holds no states of a plant
    try:
        energies = energies_of(bag, box)
        energy["run"] = balance(energies, *_whole(energies), box)
        for i, row in enumerate(rows):
            if window := _window(row):
                energy["shifts"][i] = balance(energies, *window, box)
    except RigError as error:
        problems.append(f"no energy balance: {error}")
    if truth:
        metrics["truth"] = _truth(bag, rows, box)
    return _assembled(_run_data(bag, run), problems, metrics, energy)


def _with_shifts(recording: Recording) -> tuple[Recording, list[dict]]:
    return recording, shifts(recording)


def record_of(bag: Bag | Gathered, run: dict) -> Mapping:
    """Return the record of the rig of a run in today's form; RigError when it is invalid."""
    try:
        record = rig_record(run["configuration"], bag.types) if run.get("configuration") else bag.record
        record["structure"]["gears"]
    except UNREADABLE as error:
        raise no_rig(error) from None
    return record


def no_rig(error: Exception) -> RigError:
    """Return the error of a record whose rig cannot be read."""
    return RigError(
        f"the configuration of the run does not name its rig and instruments ({type(error).__name__}: {error}); "
        f"expected what `rig run` and `rig simulate` put into a bag"
    )


def info_of(bag: Bag | Gathered) -> dict:
    """Return the information in a bag about its run, for the run part of a report."""
    info = bag.run_info()
    return info if "configuration" in info else {"configuration": info or None}


def is_of(bag: Bag | Gathered, run: dict) -> bool:
    """Return True when the run part of a report and the bag are of the same run, as far as both identify it."""
    return all(value is None or run.get(key) in (None, value) for key, value in plain(info_of(bag)).items())


def _run_data(bag: Bag | Gathered, run: dict) -> dict:
    """Return the runner's data; unknown lost messages are counted from an undamaged bag."""
    data = {key: run.get(key) for key in RUN_KEYS}
    if data["lost"] is None and not run.get("recovered"):
        data["lost"] = sum(bag.gaps().values())
    if bag.recorded_from:
        data["recorded_from_s"] = bag.recorded_from
    data.update((key, run[key]) for key in sorted(run) if key not in RUN_KEYS and key != "problems")
    return data


def report_of_recording(recording: Recording, record: Mapping) -> dict:
    """Return the report of a recording that is not a bag (a logger's CSV).

    It is as that of :func:`build_report`, without energy balance and with empty ``run`` data.

    Parameters
    ----------
    recording : Recording
        The recording; its transmission should be that of ``record`` (transmission_of).
    record : mapping
        Record of the rig, as a bag holds it, which gives the instruments.

    Returns
    -------
    dict
        The report.

    Raises
    ------
    RigError
        When the recording has no order.
    """
    if not recording.orders:
        example = example_of_orders(recording.transmission)
        raise RigError(f"the recording holds no order of a gear; give them with --orders, e.g. '{example}'")
    problems: list[str] = []
    instruments = instruments_of(record)
    metrics = _metrics(recording, shifts(recording), instruments, None, problems)
    metrics["basis"] = basis_of(record, recording.transmission, instruments)
    energy = {"run": None, "shifts": [None] * len(metrics["shifts"])}
    return _assembled(dict.fromkeys(RUN_KEYS), problems, metrics, energy)


def _metrics(
    recording: Recording | None,
    rows: list[dict],
    instruments: dict[str, Instrument],
    annex_a: float | None,
    problems: list[str],
    bag: Bag | Gathered | None = None,
    gathered: Gathered | None = None,
) -> dict:
    """Return everything that comes from the logger's channels; a run without a change of gear also needs the bag's commands."""
    found: dict[str, Any] = {
        "shifts": rows,
        "quality": [quality_of(row, recording.transmission) for row in rows] if recording else [],
        "uncertainty": [uncertainty(row, instruments, recording.transmission, recording.period) for row in rows]
        if recording
        else [],
    }
    if annex_a is not None and recording is not None:
        try:
            found["annex_a"] = {"factor": annex_a, "shifts": _by_annex_a(recording, annex_a, gathered)}
        except RigError as error:
            problems.append(f"no results by Annex A: {error}")
    if recording is not None and not any(recording.transmission.changes(row["from_gear"], row["to_gear"]) for row in rows):
        found["measured"] = measured(recording, instruments, bag)
    return found


def _by_annex_a(recording: Recording, factor: float, gathered: Gathered | None) -> list[dict]:
    """Return the results by Annex A, which were gathered where the recording does not hold all rows."""
    rows = None if gathered is None else gathered.by_annex_a()
    return shifts_annex_a(recording, a=factor, b=factor) if rows is None else rows


def basis_of(record: Mapping, box: Transmission, instruments: dict[str, Instrument]) -> dict:
    """Return the values with which a report was computed [SI]; ``taken`` is added when the bag does not record its rig."""
    pressures = [clutch.pressure for clutch in box.clutches if clutch.pressure]
    return {
        "rig": record.get("name", "without a name"),
        "inertia_driving": box.inertias.driving,
        "inertia_driven": box.inertias.driven,
        "ratios": {box.names[gear]: ratio for gear, ratio in box.ratios.items()},
        "largest_errors": {name: instruments[name].error for name in ("torque", *pressures, "speed")},
    }


def _truth(bag: Bag | Gathered, rows: list[dict], box: Transmission) -> list[dict | None]:
    states = states_of(bag, box)
    ends = [row["t_order_s"] for row in rows[1:]] + [None]
    return [None if states is None else metrics_of_states(states, row, box, end) for row, end in zip(rows, ends)]


def _assembled(run: dict, problems: list[str], metrics: dict, energy: dict) -> dict:
    """Return the parts in their order, as plain JSON values."""
    if problems:
        run["problems"] = problems
    rest = {key: metrics[key] for key in ("quality", "uncertainty", "basis", "measured", "annex_a", "truth") if key in metrics}
    return plain({"run": run, "shifts": metrics["shifts"], "energy": energy, **rest})


def recording_of(bag: Bag, transmission: Transmission) -> Recording:
    """Return the bag's 10 kHz channels and its orders.

    Parameters
    ----------
    bag : Bag
        The bag.
    transmission : Transmission
        That of the bag's rig.
    """
    # missing rows become NaN, so that they affect only the shifts in which they lie
    logger = bag.logger(fill=True)
    return Recording(logger.t0, logger.period, logger.channels, orders_in(bag.events()), transmission)


def _whole(energies: Mapping[str, Series]) -> tuple[float, float]:
    times = energies.get("motor_work", (np.zeros(1), None))[0]
    return float(times[0]), float(times[-1])


def _window(row: dict) -> tuple[float, float] | None:
    """Return the times of the order and of the settled torque, or of lock-up where t_o is not defined; None if it was not found."""
    if not row["t_c_s"] or (row["t_o_s"] is None and "t_o_s" not in reasons_in(row)):
        return None
    return row["t_order_s"], row["t_order_s"] + row["t_c_s"] + (row["t_o_s"] or 0.0)


def plain(value: object) -> Any:
    """Return a value reduced to what JSON can hold: dicts, lists, text, booleans, finite numbers, None."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(item) for item in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value if value is None else str(value)


def write_report(folder: str | Path, report: dict) -> Path:
    """Write ``report.json`` into a run's folder and return its path.

    The file is written under another name and then renamed, so that a reader finds either the old or the new report.
    """
    path = Path(folder) / REPORT_FILE
    atomic_write(path, json.dumps(report, indent=2, ensure_ascii=False, allow_nan=False) + "\n")
    return path


def read_report(folder: str | Path) -> dict | None:
    """Return the report in a run's folder, or None when there is none.

    Raises
    ------
    RigError
        When the file is not a report.
    """
    path = Path(folder) / REPORT_FILE
    if not path.exists():
        return None
    try:
        if path.stat().st_size > limits.JSON:
            raise ValueError(f"{path.stat().st_size} bytes, at most {limits.JSON} are read")
        report = json.loads(path.read_text(encoding="utf-8"))
        if limits.deeper(report, limits.JSON_DEPTH):
            raise ValueError(f"nested deeper than {limits.JSON_DEPTH} levels")
    except (OSError, ValueError, RecursionError) as error:
        raise RigError(f"{path}: is no report ({error}); delete it to have a new one made") from None
    if not isinstance(report, dict) or not isinstance(report.get("run"), dict):
        raise RigError(f"{path}: is no report (it has no 'run' part); delete it to have a new one made")
    return report


def format_report(report: dict) -> str:
    """Return the report as a table in rpm, Nm, ms and J with one line each on losses, lateness, energy and the end.

    The largest error of each metric follows under each shift after "+-". Annex A and the plant's states follow when the
    report holds them.
    """
    if "bench" in report:
        from .press_bench import bench_lines

        lines = bench_lines(report["bench"]) or range_lines(report.get("signals", []))
        return _shown([*lines, "", *_run_lines(report["run"])])
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
    return _shown([*lines, "", *_energy_lines(report, box), *_basis_lines(report), *_run_lines(report["run"])])


def verdicts_in(report: Mapping) -> list[dict | None]:
    """Return the verdict on the quality of each shift of a report; None where it has none, as in older reports."""
    found = report.get("quality") or []
    return [found[i] if i < len(found) else None for i in range(len(report["shifts"]))]


def _shown(lines: list[str]) -> str:
    """Return each text as one line, whatever characters of a bag it contains."""
    return "\n".join(map(printable, lines))


def no_shift(report: dict) -> str:
    """Return the sentence that replaces the table when a run has no row for it."""
    run = report["run"]
    if run.get("imported"):
        return (
            "no shift: the orders of gears are not given; import the file with --orders, e.g. "
            f"'{example_of_orders(shown_transmission(report))}', or with a column of the ordered gear; 'rig compare' takes the "
            "orders of another run"
        )
    if "measured" not in report:
        return "no shifts: there is nothing to look for them in"  # the report's problems give the reason
    what = f"{run['sequence']} ({run['description']})" if run.get("sequence") and run.get("description") else "this run"
    return f"no shift: {what} changes no gear while the input shaft turns"


def shown_transmission(report: Mapping) -> Transmission:
    """Return the transmission whose gears and clutches a report names; one without any where the report has no results.

    It is that of the run's record, or of the installed rig with which a bag without a record was computed. RigError is raised when
    neither can be read.
    """
    basis = report.get("basis") or {}
    if not basis and not report["shifts"]:
        return _NOTHING_SHOWN
    if basis.get("taken"):
        return load_rig(basis["rig"]).transmission
    try:
        return transmission_of(rig_record(report["run"].get("configuration")))
    except UNREADABLE as error:
        raise no_rig(error) from None


def shift_name(number: int, row: Mapping, box: Transmission, arrow: str = " -> ") -> str:
    """Return what a shift is called wherever one is named, e.g. ``shift 1, I -> II at 3.85 s``.

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
    return f"shift {number}, {box.way(row['from_gear'], row['to_gear'], arrow)} at {row['t_order_s']:.2f} s"


def numbered_way(number: int, row: Mapping, box: Transmission, arrow: str = " -> ") -> str:
    """Return number and gears of a shift for a table's head or first column, e.g. ``1: I -> II``."""
    return f"{number}: {box.way(row['from_gear'], row['to_gear'], arrow)}"


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
            if _window(row) is None and report["energy"]["run"] is not None:
                lines.append(f"energy of {name}: -, as no end of the shift was found")
            continue
        heat = clutch_heat(account, box)
        share = account["residual_of_heat"]
        share = "no clutch heat" if share is None else f"{100.0 * share:+z.2f} % of it"
        name += "" if row["valid"] else " (not valid)"
        lines.append(f"energy of {name}: clutch heat {heat:z.0f} J, unaccounted {account['residual_j']:+z.2f} J ({share})")
    if lines and _bounded(report["run"]):
        lines.append("  output_speed is bounded: the speed is set between the gears' and not by a torque, which is not accounted")
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


def _bounded(run: dict) -> bool:
    prescribed = (run.get("configuration") or {}).get("prescribed") or {}
    return prescribed.get("output_speed") == "bounded"


def _run_lines(run: dict) -> list[str]:
    if all(run[key] is None for key in RUN_KEYS):
        return [f"problem: {problem}" for problem in run.get("problems", [])]  # a logger's file, which is not a run of the rig
    since = f" (recorded from {run['recorded_from_s']:.3f} s on)" if run.get("recorded_from_s") else ""
    lines = [f"messages lost: {'unknown' if run['lost'] is None else run['lost']}{since}"]
    if left_out := run.get("left_out"):
        lines.append(f"left out by the recorder's options: {sum(left_out.values())} messages of {len(left_out)} topics")
    late = run["lateness_ms"]
    if late:
        names = {"p50": "median", "p99": "p99", "max": "max"}
        shown = ", ".join(f"{names[key]} {late[key]:.2f}" for key in names if late.get(key) is not None)
        ticks = f"{run['overruns']} of {run['ticks']} ticks more than one tick late"
        lines.append(f"lateness of ticks: {shown} ms; {ticks}")
    end = run["end"]
    reason = end.get("reason") if isinstance(end, dict) else end
    lines.append(f"end: {reason or 'unknown'}")
    if run.get("recovered"):
        lines.append(f"bag: damaged; {run['recovered']}")
    return lines + [f"problem: {problem}" for problem in run.get("problems", [])]
