# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A measuring procedure on the page's own rig, started anew for each run, as series change values that a running rig keeps.

nodes.panel.orders starts and aborts it. What is written is what `rig procedure` writes.
"""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...analysis import STEP, Member, member_of, read_report, table_of, write_procedure
from ...base import RigError
from ...runs import load_procedure, parse_settings, prepare, run_folder

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...runs import Procedure, Series
    from .own_rig import OwnRig

LOOK = 0.1  # s between two looks whether a run has ended


def series_of(file: Path, rig: str, wanted: str = "") -> tuple[Procedure, list[Series]]:
    """Return a procedure and those of its series that are named, with commas between them; all when none is."""
    procedure = load_procedure(file, rig)
    names = [name.strip() for name in wanted.split(",") if name.strip()]
    return procedure, procedure.series(names or None)


class ProcedureRun:
    """Runs of a procedure, one after the other.

    Attributes
    ----------
    progress : dict
        How far it has come, as the page shows it.

    Parameters
    ----------
    own : OwnRig
        The page's rig, which is worked by hand again afterwards.
    procedure : Procedure
        The procedure.
    chosen : list of Series
        Its series; RigError when the rig does not take one of them, before anything is stopped.
    tell : callable
        It is called with the results of the series that have run.
    """

    def __init__(self, own: OwnRig, procedure: Procedure, chosen: list[Series], tell: Callable[[dict[str, Any]], None]) -> None:
        self._own, self.procedure, self._chosen, self._tell = own, procedure, chosen, tell
        settings = parse_settings(own.settings)
        for series in chosen:
            prepare(series, own.rig, settings)
        self._runs = [(series, repeat) for series in chosen for repeat in range(series.repeats)]
        self._members: list[Member] = []
        self._folder: Path | None = None
        self._aborted = False
        self.progress: dict[str, Any] = {}
        self._now(0, "the rig that is worked by hand ends")

    def abort(self) -> str:
        """End the present run in order, and the procedure with it; return a sentence."""
        self._aborted = True
        return f"procedure '{self.procedure.name}' is aborted"

    def event(self, name: str, text: str) -> None:
        """Take an event of the sequence that runs."""
        if name == STEP:
            self._now(self.progress["step"], text)

    def _now(self, number: int, text: str) -> None:
        of = {"running": True, "what": "run", "step": number, "steps": len(self._runs)}
        series, repeat = self._runs[max(0, number - 1)]
        where = f"series {series.label}, run {repeat + 1} of {series.repeats}: " if number else ""
        self.progress = of | {"text": f"{where}{text}"}

    async def run(self) -> str:
        """Run it; return a sentence on its end.

        Raises
        ------
        RigError
            When a run did not end as planned; the others are not begun, because somebody may have stopped the rig.
        """
        await asyncio.to_thread(self._own.stop)
        name, count = self.procedure.name, len(self._runs)
        self._folder = run_folder(None, name)
        for number, (series, repeat) in enumerate(self._runs, 1):
            if self._aborted:
                break
            self._now(number, "the rig starts")
            folder = self._folder / f"{series.label}-{repeat + 1}"
            try:
                await self._one(series, repeat, folder)
            except RigError as error:
                if not self._aborted:
                    raise RigError(f"procedure '{name}' ended with {folder.name}, run {number} of {count}: {error}") from None
        done = f"{len(self._members)} of {count} runs" if self._aborted else f"{count} runs"
        return f"procedure '{name}' {'was aborted' if self._aborted else 'is done'}: {done} are in {self._folder}"

    async def _one(self, series: Series, repeat: int, folder: Path) -> None:
        """Do one run; RigError with the reason when it has not ended as planned."""
        given = [f"--with={name}={value}" for name, value in series.parameters.items()]
        given += [f"--set={name}={value}" for name, value in series.overrides.items()]
        self._own.start([series.sequence, *given, f"--seed={series.first_seed + repeat}"], folder)
        try:
            while not self._own.ended and not self._aborted:
                await asyncio.sleep(LOOK)
        finally:
            await asyncio.to_thread(self._own.stop)
        report = await asyncio.to_thread(read_report, folder)
        if report is None:
            raise RigError(self._own.how)
        member = member_of(series.label, folder.name, report)
        if member.failed:
            raise RigError(member.failed)
        self._members.append(member)
        rows = [one.about for one in self._chosen]
        await asyncio.to_thread(write_procedure, folder.parent, self.procedure.about, rows, self._members)
        head, table = table_of(self._members)
        self._tell({"kind": "found", "procedure": self.procedure.name, "head": head, "rows": table})
