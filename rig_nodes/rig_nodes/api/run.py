# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A run of any origin from Python: its signals, shifts, events and report; ``Rig.simulate`` and ``rig_nodes.open`` give it."""

from __future__ import annotations

import shutil
import weakref
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..analysis import build_report, every_metric, gather, info_of, is_of, read_report, shown_transmission, verdicts_in
from ..bags import NO_REPORT, Bag, with_end
from ..base import RigError, not_written
from .signals import Signals
from .table import Table

if TYPE_CHECKING:
    from collections.abc import Mapping


class Run:
    """A run: what `rig simulate` or `rig run` recorded, or the file of a logger that was opened.

    ``Rig.simulate`` and :func:`rig_nodes.open` make it; it reads its bag when something is asked of it.

    Attributes
    ----------
    folder : Path
        The run's folder or bag. That of a run that was not saved is temporary and goes with this object.

    Examples
    --------
    >>> run = rig_nodes.load("hydmag").simulate("demo")
    >>> run.end
    {'state': 'ended', 'reason': 'the sequence ended'}
    >>> run.shifts["to_gear"], run.shifts["k"].round(3)
    (array(['II', 'I'], dtype=object), array([0.999, 1.004]))
    >>> run.events[0]["text"]
    'the rig is ready'
    """

    def __init__(self, folder: Path, report: dict | None = None, temporary: bool = False) -> None:
        """Take a run's folder or bag; ``report`` is its report where it is known, and a temporary folder is removed at the end."""
        self.folder = folder
        if report is not None:
            self.report = report
        if temporary:
            weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)

    @cached_property
    def signals(self) -> Signals:
        """The signals by name, in SI, e.g. ``run.signals["p1"]``."""
        return Signals(self.folder)

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
    def shifts(self) -> Table:
        """One row for each shift: gears, time of the order, metrics, ``valid`` and ``quality``.

        Columns are named as in report.json; `rig list metrics` describes them.
        """
        report = self.report
        box, metrics = shown_transmission(report), every_metric()
        units = {"from_gear": "", "to_gear": "", "t_order_s": "s", **{one.key: one.unit.strip("-") for one in metrics}}
        rows = [
            {
                **row,
                "from_gear": box.short(row["from_gear"]),
                "to_gear": box.short(row["to_gear"]),
                "quality": (verdict or {}).get("grade"),
            }
            for row, verdict in zip(report["shifts"], verdicts_in(report))
        ]
        return Table({**units, "valid": "", "quality": ""}, rows)

    @cached_property
    def events(self) -> Table:
        """What happened and was ordered: ``time`` [s], ``topic``, ``name``, ``text``, ``value``."""
        names = ("time", "topic", "name", "text", "value")
        units = dict.fromkeys(names, "") | {"time": "s"}
        return Table(units, [dict(zip(names, event)) for event in Bag(self.folder).events()])

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
        target = Path(folder)
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
        return target
