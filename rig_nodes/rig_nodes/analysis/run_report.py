# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of a run: run data, shift metrics with errors, energy balance, as ``report.json`` holds it.

`rig run`, `rig simulate` and `rig report` make it; analysis.report_text writes it as text. Everything except the run data is
computed from the bag.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..bags import NOTHING, UNREADABLE, Bag, Recording, example_of_orders, holds_rig, limits, orders_in, rig_record
from ..base import BagError, RigError, atomic_write
from ..rig import End, Inertias, Transmission, load_rig, transmission_of
from .annex_a import shifts_annex_a
from .clipped import clipped_in
from .clutch_torques import put_torques
from .definitions import reasons_in
from .energy import Series, balance, energies_of
from .faults import faults_in
from .gathered import Gathered
from .loops import STEP, put_loops
from .measured_error import Instrument, instruments_of, uncertainty
from .no_change import measured
from .peak import put_peaks
from .plant_states import metrics_of_states, states_of
from .quality import quality_of
from .ranges import signal_ranges
from .shift import shifts
from .state_at_order import put_states
from .trips import trips_in, warnings_in

REPORT_FILE = "report.json"
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
        The bag in memory, or what :func:`analysis.of_runs.gather` gathered of its pieces, with the same ``annex_a``.
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
        return _without_gears(bag, run, record)
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
        put_peaks(bag, rows, box)
        put_states(bag, record, box, rows)
        put_loops(rows, info_of(bag).get("loops"), ((t, value) for t, _, name, _, value in bag.events() if name == STEP))
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
            if window := window_of(row):
                energy["shifts"][i] = balance(energies, *window, box)
    except RigError as error:
        problems.append(f"no energy balance: {error}")
    if truth:
        metrics["truth"] = _truth(bag, rows, box)
    return _assembled(_run_data(bag, run), problems, metrics, energy)


def _without_gears(bag: Bag | Gathered, run: dict, record: Mapping) -> dict:
    """Return the report of a rig without gears."""
    from .press_bench import bench_report

    problems: list[str] = []
    found = bench_report(bag, record, problems)
    problems += clipped_in(bag, record)
    return _assembled(_run_data(bag, run), problems, {"shifts": [], "uncertainty": []}, {"run": None, "shifts": []}) | {
        "bench": plain(found),
        "signals": plain(bag.ranges.rows() if isinstance(bag, Gathered) else signal_ranges(bag)),
    }


def _with_shifts(recording: Recording) -> tuple[Recording, list[dict]]:
    return recording, shifts(recording)


def record_of(bag: Bag | Gathered, run: dict) -> Mapping:
    """Return the record of the rig of a run in today's form; RigError when it is invalid."""
    try:
        record = rig_record(run["configuration"], bag.types) if run.get("configuration") else bag.record
        record["structure"]["gears"]
    except BagError:
        raise  # its sentence is whole
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
    events = bag.events()
    if faults := faults_in(events):
        data["faults"] = faults
    if trips := trips_in(events):
        data["trips"] = trips
    if warned := warnings_in(events):
        data["trip_warnings"] = warned
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
        raise RigError(f"the recording holds no order of a gear; give them with --orders, in Python orders=, e.g. '{example}'")
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
    found: dict[str, Any] = {"shifts": rows, "quality": [], "uncertainty": []}
    if recording is not None:
        box = recording.transmission
        found["uncertainty"] = [uncertainty(row, instruments, box, recording.period) for row in rows]
        found["quality"] = [quality_of({**row, "errors": own}, box) for row, own in zip(rows, found["uncertainty"])]
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


def window_of(row: dict) -> tuple[float, float] | None:
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


def verdicts_in(report: Mapping) -> list[dict | None]:
    """Return the verdict on the quality of each shift of a report; None where it has none, as in older reports."""
    found = report.get("quality") or []
    return [found[i] if i < len(found) else None for i in range(len(report["shifts"]))]


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
