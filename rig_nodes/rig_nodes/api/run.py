# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A run of any origin from Python: its signals, shifts, events and report; ``Rig.simulate`` and ``rig_nodes.open`` give it."""

from __future__ import annotations

import shutil
from base64 import b64encode
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..analysis import (
    SHORT,
    Source,
    build_report,
    flat,
    gather,
    info_of,
    is_of,
    loop_columns,
    metric_keys,
    named_metrics,
    read_report,
    shown_transmission,
    source_of,
    verdicts_in,
)
from ..bags import NO_REPORT, Rows, arrow_schema, arrow_table, on_one_clock, on_own_clocks, with_end
from ..bags import Signals as Groups
from ..base import RigError, atomic_write, brief, not_written, optional
from .compared import Compared
from .exported import Exported, exported
from .given import chosen, path_of, product, seconds_of, texts
from .paged import page_of
from .signals import Signals
from .table import GEARS, Table, column_unit
from .temporary import Temporary

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import pandas
    import pyarrow
    from matplotlib.figure import Figure

    from ..rig import Transmission
    from .reran import Rerun
    from .rig import Rig

MOST_ROWS = 1_000_000  # of a recording that is compared, 100 s at 10 kHz
NO_GEARS = "no shifts: the rig has no gears"
BESIDE = ("why", "undefined")  # keys of a shift in the report that hold no value
PAGES = {".html": "page", ".pdf": "pdf"}  # endings of the page of a run, and its kind of file


class Run:
    """A run: what `rig simulate` or `rig run` recorded, or the file of a logger that was opened.

    ``Rig.simulate`` and :func:`rig_nodes.open` make it; it reads its bag when something is asked of it.

    Attributes
    ----------
    folder : Path
        The run's folder or bag; after :meth:`save` the saved folder. That of a run that was not saved is temporary and goes
        with this object and its signals.

    Examples
    --------
    >>> run = rig_nodes.load("hydmag").simulate("demo")
    >>> run.end
    {'state': 'ended', 'reason': 'the sequence ended'}
    >>> run.shifts["to_gear"], run.shifts["k"].round(3)
    (array(['II', 'I'], dtype=object), array([0.997, 0.976]))
    >>> run.events[0]["text"]
    'the rig is ready'
    """

    def __init__(self, folder: Path, report: dict | None = None, temporary: Temporary | None = None) -> None:
        """Take a run's folder or bag; ``report`` is its report where it is known, ``temporary`` keeps a temporary folder."""
        self.folder, self._temporary = folder, temporary
        if report is not None:
            self.report = report

    @cached_property
    def signals(self) -> Signals:
        """The signals by name, in SI, e.g. ``run.signals["p1"]``."""
        return Signals(self.folder, self._temporary)

    @cached_property
    def report(self) -> dict[str, Any]:
        """The report as `rig report --json` prints it, computed from the bag.

        Raises
        ------
        RigError
            When the bag is damaged, or nothing was recorded.
        """
        bag = gather(self.folder)
        bag.check_began()
        old = read_report(self.folder) if self.folder.is_dir() else None
        known = old["run"] if old and is_of(bag, old["run"]) else {**info_of(bag), "end": {"reason": NO_REPORT}}
        return build_report(bag, with_end(bag, known))

    @property
    def end(self) -> Mapping[str, str]:
        """How the run ended: ``state`` (ended, failed, tripped, ...) and ``reason``."""
        return self.report["run"]["end"]

    @cached_property
    def record(self) -> Mapping[str, Any]:
        """The rig of the run as its bag records it: structure and values."""
        return self.signals.about.record

    @cached_property
    def shifts(self) -> Table:
        """One row for each shift: gears, time of the order, values of the loops around it, metrics, ``valid`` and ``quality``.

        Columns are named as in report.json, and `rig list metrics` describes them; printing shows the most asked for.
        """
        report = self.report
        box, rows, units = shown_transmission(report), [], {}
        for row, verdict in zip(report["shifts"], verdicts_in(report)):
            loops = loop_columns(row)
            units |= {name: unit for name, (_, unit) in loops.items()}
            parts = {f"peak.{name}": value for name, value in (row.get("peak") or {}).items()}
            rows.append(shift_cells(row, verdict, box) | {name: value for name, (value, _) in loops.items()} | parts | flat(row))
        names = dict.fromkeys(name for row in rows for name in row) or dict.fromkeys([*_keys(), "quality"])
        ends = ("valid", "quality")
        order = ["from_gear", "to_gear", "t_order_s", *units, *(name for name in names if name not in ends), *ends]
        shown = [*order[: 3 + len(units)], *(one.key for one in named_metrics(SHORT)), *ends]
        return Table({name: units.get(name, column_unit(name)) for name in dict.fromkeys(order)}, rows, shown)

    @cached_property
    def events(self) -> Table:
        """What happened and was ordered: ``time`` [s], ``topic``, ``name``, ``text``, ``value``."""
        names = ("time", "topic", "name", "text", "value")
        units = dict.fromkeys(names, "") | {"time": "s"}
        return Table(units, [dict(zip(names, event)) for event in self.signals.about.events()])

    def save(self, folder: str | Path) -> Path:
        """Save the run as `rig simulate --out` leaves it: bag, metadata.yaml, report.json, run.json.

        Parameters
        ----------
        folder : str or Path
            A folder that is new or empty.

        Returns
        -------
        Path
            The folder.

        Raises
        ------
        RigError
            When the folder is not empty or cannot be written.

        Examples
        --------
        >>> run = rig_nodes.load("hydmag").simulate("demo")
        >>> run.save("runs/first")
        PosixPath('runs/first')
        >>> rig_nodes.open("runs/first").shifts["k"] == run.shifts["k"]
        array([ True,  True])
        """
        target = path_of("folder", folder)
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            raise RigError(f"{target}: is there already and is not an empty folder; choose a new name")
        try:
            if self.folder.is_dir():
                shutil.copytree(self.folder, target, dirs_exist_ok=True)
            else:
                target.mkdir(parents=True, exist_ok=True)
                shutil.copy(self.folder, target)
        except OSError as error:
            raise not_written(target, error) from None
        self.folder, self._temporary = target.absolute(), None
        return target

    def to_pandas(
        self, signals: Sequence[str] | None = None, *, period: float | str | None = None, units: str = "si"
    ) -> pandas.DataFrame:
        """Return signals as a DataFrame over the time of the run.

        The rows are those of the logger (10 kHz unless the rig says otherwise), which are not resampled. A signal that comes less
        often keeps its last value until the next one, and is NaN before its first.

        Parameters
        ----------
        signals : sequence of str, optional
            Names, or patterns such as ``p*``; all by default.
        period : float or str, optional
            Time between rows [s], or as text with its unit; each row then has the last value of each signal.
        units : str
            ``"si"``, or ``"shown"`` for the units that people read (rpm, MPa, mA).

        Returns
        -------
        pandas.DataFrame
            A column for each signal; the index is the time [s], and ``attrs["units"]`` has the units.

        Raises
        ------
        RigError
            When there is no such signal, or pandas is not installed.

        Examples
        --------
        >>> frame = rig_nodes.load("hydmag").simulate("demo").to_pandas(["n_wej", "s2_slip"], period="1 ms", units="shown")
        >>> float(frame.loc[5.0:6.0, "n_wej"].mean().round(-2)), frame.attrs["units"]["s2_slip"]
        (1500.0, 'rpm')
        """
        pandas = optional("pandas")
        chosen, rows = self._rows(signals, period, units)
        columns = [column for group in chosen.groups for column in group.columns]
        found = list(rows)
        values = np.vstack([one.values for one in found]) if found else np.empty((0, len(columns)))
        times = np.concatenate([one.times for one in found]) / 1e9 if found else np.empty(0)
        frame = pandas.DataFrame(values, pandas.Index(times, name="time"), [column.name for column in columns])
        frame.attrs["units"] = {column.name: column.unit for column in columns}
        return frame

    def to_arrow(
        self, signals: Sequence[str] | None = None, *, period: float | str | None = None, units: str = "si"
    ) -> pyarrow.Table:
        """Return signals as a table of Arrow, from which polars and others make theirs; the arguments are as of :meth:`to_pandas`.

        Returns
        -------
        pyarrow.Table
            The ``time`` [s] and a column for each signal, null where it has no value; unit and description are in the fields'
            metadata.

        Raises
        ------
        RigError
            When there is no such signal, or pyarrow is not installed.

        Examples
        --------
        >>> table = rig_nodes.load("hydmag").simulate("demo").to_arrow(["p1"], period=0.01)
        >>> table.column_names, table.field("p1").metadata[b"unit"]
        (['time', 'p1'], b'Pa')
        """
        chosen, rows = self._rows(signals, period, units)
        schema = arrow_schema(chosen)
        table = optional("pyarrow").concat_tables([schema.empty_table(), *(arrow_table(one, schema) for one in rows)])
        return table.rename_columns(["time", *table.column_names[1:]])

    def export(
        self, file: str | Path, signals: Sequence[str] | None = None, *, period: float | str | None = None, units: str = "si"
    ) -> Exported:
        """Write the run to a file, as `rig export`, of the kind that its ending says.

        Parameters
        ----------
        file : str or Path
            The file, which must not be there yet: .csv, .parquet, .mf4 or .mat; .blf, .asc or .log for its CAN frames.
        signals : sequence of str, optional
            As of :meth:`to_pandas`.
        period : float or str, optional
            Of .csv and .parquet the time between rows [s], or as text with its unit; by default the rows are those of the signals.
        units : str
            As of :meth:`to_pandas`.

        Returns
        -------
        Exported
            The ``file``, the ``count`` of its signals or frames, and what was ``left_out`` or ``cut_off``.

        Raises
        ------
        RigError
            When there is no such kind or signal, a package is missing, or the file is there or cannot be written.

        Examples
        --------
        >>> found = rig_nodes.load("hydmag").simulate("demo").export("torque.csv", ["M_wej", "M_wyj"], period="10 ms")
        >>> found.count, found.file.read_text().splitlines()[0]
        (2, 't [s],M_wej [Nm],M_wyj [Nm]')
        """
        self._check(signals, units)
        return exported(self.folder, path_of("file", file), list(signals or ()), period, units)

    def page(self, file: str | Path) -> None:
        """Write the page of the run, as `rig report --html` and `--pdf`.

        Parameters
        ----------
        file : str or Path
            The file: .html, one page that contains all it shows; or .pdf, which a Chromium or Chrome on the PATH prints.

        Raises
        ------
        RigError
            When the file has another ending, is somebody else's or cannot be written, or there is no browser for a .pdf.
        """
        if (kind := PAGES.get(path_of("file", file).suffix.lower())) is None:
            raise RigError(f"{file}: the page of a run is a file that ends in {' or '.join(PAGES)}")
        target, text = product("file", file, kind), page_of(gather(self.folder), self.report)
        from ..view import pdf_of

        atomic_write(target, pdf_of(text) if kind == "pdf" else text)

    def _check(self, names: Sequence[str] | None, units: str) -> None:
        """RigError for names that are no list or no signals, and for other units."""
        if units not in ("si", "shown"):
            raise RigError(f"units is {brief(units)}, expected 'si' or 'shown'")
        for name in texts("signals", names):
            if not any(sign in name for sign in "*?["):
                self.signals.check(name)

    def _rows(self, names: Sequence[str] | None, period: float | str | None, units: str) -> tuple[Groups, Iterator[Rows]]:
        """Return the chosen signals and their rows on one clock, or at their own times in a run without a logger."""
        self._check(names, units)
        chosen = Groups(self.folder, list(names or ()), units)
        seconds = seconds_of("period", period) or self.signals.period
        if seconds is None:
            return chosen, on_own_clocks(chosen.groups, chosen.parts())
        return chosen, on_one_clock(chosen.groups, chosen.parts(), round(seconds * 1e9))

    def plot(self, shift: int | None = None, dark: bool = False) -> Figure:
        """Draw the run, or one of its shifts: pressures, torques and speeds with phases, peaks, limits and the verdict.

        Parameters
        ----------
        shift : int, optional
            Number of a shift from 1 on; the whole run by default.
        dark : bool
            True for a dark ground.

        Returns
        -------
        matplotlib.figure.Figure
            The figure, of which a notebook shows the picture; ``savefig`` writes it to a file.

        Raises
        ------
        RigError
            When there is no such shift, or matplotlib is not installed.

        Examples
        --------
        >>> run = rig_nodes.load("hydmag").simulate("demo")
        >>> run.plot(shift=1).savefig("shift.png")
        """
        optional("matplotlib")
        from ..view import Pages, draw_figure, figure_of_shift, figures_of_run

        count, pages, span = len(self.report["shifts"]), Pages(self.record), self.signals.span
        if shift is None:
            return draw_figure(figures_of_run(self.report, pages, self.folder, span)[0], dark)
        number = chosen("shift", shift, count, "the run") + 1
        return draw_figure(figure_of_shift(self.report, number, pages, self.signals, span), dark)

    def compare(self, *others: Run | str | Path, by: str | None = None) -> Compared:
        """Compare with other runs, as `rig compare`.

        Parameters
        ----------
        *others : Run, str or Path
            The other runs, or what :func:`rig_nodes.open` takes.
        by : str, optional
            How they are aligned, ``"events"`` or ``"correlation"``; by default by events where all hold the same orders.

        Returns
        -------
        Compared
            Clocks, and metrics and signals with their differences in measuring errors.

        Raises
        ------
        RigError
            When a run is of a rig without gears, or cannot be aligned.

        Examples
        --------
        >>> rig = rig_nodes.load("hydmag")
        >>> found = rig.simulate("demo", seed=1).compare(rig.simulate("demo", seed=2))
        >>> found.metrics[0]["metric"], found.metrics[0]["in_errors"] < 1.0
        ('input_speed_rpm', True)
        """
        if not others:
            raise RigError("compare takes one or more other runs, e.g. run.compare(other)")
        from .opened import open  # which makes runs

        return Compared([(one if isinstance(one, Run) else open(one)).source() for one in (self, *others)], by)

    def rerun(
        self,
        through: str | type = "plant",
        *,
        rig: Rig | str | None = None,
        settings: Mapping[str, Any] | None = None,
        level: str | None = None,
    ) -> Rerun:
        """Run it again, as `rig rerun`: its recorded commands through a plant, or its transducers through a controller.

        Parameters
        ----------
        through : str or type
            ``"plant"``, or a controller as of :meth:`Rig.simulate`.
        rig : Rig or str, optional
            Another rig; by default the one that the run has recorded.
        settings : mapping, optional
            Values of the rig in place of its own, as of :func:`rig_nodes.load`.
        level : str, optional
            What the controller returns, ``"duty"`` or ``"current"``, where it can return both.

        Returns
        -------
        Rerun
            The new ``run``, which is temporary until it is saved; the topics that are ``different`` and the metrics that
            ``moved``; or the controller's ``answers`` beside the recorded ones.

        Raises
        ------
        RigError
            When the run lacks its beginning or messages, or does not fit the rig or the controller.

        Examples
        --------
        >>> run = rig_nodes.load("hydmag").simulate([{"oil": {"pressure": "4 MPa"}}, {"wait": {"for": "100 ms"}}])
        >>> run.rerun().different, run.rerun(settings={"oil_supply": {"temperature": "50 degC"}}).different[0]
        ([], ...)
        >>> answers = run.rerun("alfa46").answers
        >>> answers.same == answers.samples
        True
        """
        from .reran import rerun_of  # which makes runs

        return rerun_of(self, through, rig, settings, level)

    def source(self) -> Source:
        """Return the run as a comparison takes it; RigError for a rig without gears."""
        run = self.report["run"]
        seed = "" if run.get("seed") is None else f"seed {run['seed']}"
        facts = (run.get("sequence"), seed, (run.get("controller") or {}).get("name"))
        name = ", ".join(filter(None, facts)) if self._temporary else str(self.folder)
        return source_of(name, gather(self.folder, most_rows=MOST_ROWS))

    def __repr__(self) -> str:
        return f"{self._head}\n{self.shifts!r}" if self._gears else f"{self._head}\n{NO_GEARS}"

    @property
    def _gears(self) -> bool:
        return bool(self.signals.about.structure.gears)

    @property
    def _head(self) -> str:
        """One line on rig, sequence, length and end."""
        run = self.report["run"]
        how = {"simulate": "simulated", "import": "imported"}.get(run.get("mode", ""), run.get("mode") or "recorded")
        seed = "" if run.get("seed") is None else f", seed {run['seed']}"
        end = f"{self.end.get('state', 'end')}: {self.end.get('reason') or 'unknown'}"
        name, rig = run.get("sequence") or self.folder.name, self.record.get("name", "a rig")
        return f"run {name} of {rig}, {how}, {self.signals.span[1]:.1f} s{seed}; {end}"

    def _repr_html_(self) -> str:
        picture = ""
        try:
            drawn = self.plot(1 if len(self.shifts) else None)
            picture = f'<img width="770" src="data:image/png;base64,{b64encode(drawn._repr_png_()).decode()}">'
        except RigError:
            pass  # without matplotlib there is no picture
        shifts = self.shifts._repr_html_() if self._gears else f"<p>{NO_GEARS}</p>"
        return f"<p>{escape(self._head)}</p>{shifts}{picture}"


def shift_cells(row: Mapping[str, Any], verdict: Mapping[str, Any] | None, box: Transmission) -> dict[str, Any]:
    """Return gears, metrics and quality of a shift by their columns in :attr:`Run.shifts`; None where there is none."""
    gears = {name: box.short(row[name]) for name in GEARS}
    return {key: row.get(key) for key in _keys()} | gears | {"quality": (verdict or {}).get("grade")}


def _keys() -> list[str]:
    return [key for key in metric_keys() if key not in BESIDE]
