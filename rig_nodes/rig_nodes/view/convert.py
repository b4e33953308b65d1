# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Conversion of a bag to a Rerun file: all signals in display units, states, events, report and layout.

`rig view` uses it. The file is written beside the bag, and only when one of its sources has changed.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import warnings
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from .. import __version__
from ..analysis import LOGGER, REPORT_FILE, SMALL, build_report, gather, gathering, is_of, read_report, with_ends
from ..bags import CUT_OFF, NO_REPORT, PIECE, Bag, Numbers, OpenedBags, orders_in, recovered
from ..base import RigError, optional, unknown
from . import layout
from .curves import OWN_TOPIC, Curves, extend, times
from .document import event_row, report_document, run_document
from .moments import MomentCurves, Reader, log_offset, measured_pages, metrics_of, shift_page
from .pages import Pages

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from types import ModuleType

    from rerun import RecordingStream
    from rerun.blueprint import Blueprint
    from rerun.chunk import Chunk

APPLICATION = "virtual_rig"
VIEW_FILE = "view.rrd"
LONG = 60.0  # s; the viewer cannot hold every row of the loggers of a longer stretch
EARLY = 0.1  # s; a bag that holds the beginning of its run has messages before this time


@dataclass(frozen=True)
class View:
    """The view of a run: its file, whether it was written anew, what the bag lacks, and whether that is damaged or cut off."""

    path: Path
    written: bool
    notes: list[str]
    faulty: bool


def make_view(run: str | Path, window: tuple[float, float] | None = None, wanted: Sequence[int] | str | None = None) -> View:
    """Write ``view.rrd`` beside the bag of a run, unless it exists and was made from the same sources.

    Parameters
    ----------
    run : str or Path
        Folder of a run or its .mcap file; a cut bag is shown as far as it reaches.
    window : (float, float), optional
        Start and end with which the plots open [s].
    wanted : sequence of int, "all" or None
        Shifts to show (layout.columns_of).

    Returns
    -------
    View
        The file and what the bag lacks.

    Raises
    ------
    BagError
        When nothing of the bag can be read, or nothing was recorded into it.
    RigError
        When rerun-sdk is missing, the file cannot be written, the window lies outside the run or it has no such shift.
    """
    with OpenedBags([run]) as index:
        index.check_began()
        import_rerun()
        path = index.files[0].parent / VIEW_FILE
        key = _key(index, window, wanted)
        fresh = _key_of(path) != key
        source = _Source(index, run, window, wanted) if fresh else None
        notes = list(index.damage)
        if source is not None:
            with whole_file(path, "copy the run to a writable folder") as part:
                notes = _write(source, part, key)
        lacks, faulty = _lacks(index)
        return View(path, fresh, notes + lacks, faulty or bool(source and source.damaged))


@contextmanager
def whole_file(path: Path, remedy: str) -> Iterator[Path]:
    """Give the name of a file that replaces another one at the end; RigError, with a remedy, when it cannot be written."""
    try:
        handle, name = tempfile.mkstemp(prefix=".view-", suffix=".rrd", dir=path.parent)
    except OSError as error:
        raise RigError(f"{path}: cannot be written ({error.strerror}); {remedy}") from None
    os.close(handle)
    try:
        yield Path(name)
        os.chmod(name, 0o644)  # mkstemp makes the file private
        os.replace(name, path)
    except OSError as error:
        raise RigError(f"{path}: cannot be written ({error.strerror})") from None
    finally:
        Path(name).unlink(missing_ok=True)


@contextmanager
def recording(path: Path, key: str, shown: Callable[[], Blueprint] | None = None) -> Iterator[tuple[ModuleType, RecordingStream]]:
    """Give the rerun module and a recording that is written to a file with its layout; without one it is sent later.

    ``shown`` makes the layout once the module is there.
    """
    rr = import_rerun()
    rec = rr.RecordingStream(APPLICATION, recording_id=key, send_properties=False)  # properties hold the wall clock
    rec.save(path, default_blueprint=shown() if shown else None)
    yield rr, rec
    rec.flush()
    rec.disconnect()


def make_tab_view(
    view: Path,
    run: str | Path,
    window: tuple[float, float] | None,
    path: Path,
    tab: str | None = None,
    wanted: Sequence[int] | str | None = None,
) -> None:
    """Write a copy of a run's view whose layout is one tab, without the viewer's own bars, for a picture of it.

    The copy holds only that layout, because the viewer may take either of two layouts.

    Parameters
    ----------
    view : Path
        The file of :func:`make_view`.
    run : str or Path
        Folder of the run or its .mcap file.
    window : (float, float) or None
        Start and end with which the plots open [s].
    path : Path
        File of the copy.
    tab : str, optional
        One of layout.TABS, or a page of the rig's own; by default the tab with which the view opens.
    wanted : sequence of int, "all" or None
        Shifts to show (layout.columns_of).

    Raises
    ------
    RigError
        When the run has no such tab.
    """
    with OpenedBags([run]) as index:
        source = _Source(index, run, window, wanted)
        tab = source.tab(tab)
    extremes: layout.Extremes = {}

    def measured(chunks: Iterable[Chunk]) -> Iterator[Chunk]:
        for chunk in chunks:
            if "Scalars:scalars" in (found := chunk.to_record_batch()).schema.names:
                values = found.column("Scalars:scalars").flatten().to_numpy(zero_copy_only=False)
                extend(extremes, chunk.entity_path.strip("/"), values)
            yield chunk

    with recording(path, "tab") as (rr, rec):
        rec.send_chunks(measured(rr.chunk.RrdReader(view).stream()))
        rec.send_blueprint(source.blueprint(tab, extremes))


def make_close_view(run: str | Path, path: Path, tab: str | None, wanted: Sequence[int] | str | None) -> View | None:
    """Write only what the tab of the moments needs, with its layout, for a picture of it, without reading the whole bag.

    Parameters
    ----------
    run : str or Path
        Folder of a run or its .mcap file.
    path : Path
        File of the view.
    tab : str or None
        The tab, as in :func:`make_tab_view`.
    wanted : sequence of int, "all" or None
        Shifts to show (layout.columns_of).

    Returns
    -------
    View or None
        None, with no file written, for another tab, or for a run whose report is not beside the bag.
    """
    with OpenedBags([run]) as index:
        index.check_began()
        source = _Source(index, run, None, wanted)
        tab = source.tab(tab)
        if source.report is None or tab not in [one.page.key for one in source.close]:
            return None
        with recording(path, "close", lambda: source.blueprint(tab, {})) as (rr, rec):
            source.send(rr, rec)
            _send_texts(rr, rec, source, source.report, [])
        lacks, faulty = _lacks(index)
        return View(path, True, index.damage + lacks, faulty)


def import_rerun() -> ModuleType:
    """Return the rerun module; RigError with the remedy when this environment does not have it."""
    for part in ("blueprint", "chunk"):
        optional(f"rerun.{part}", "view")
    return optional("rerun", "view")


def _key(bag: OpenedBags, window: tuple[float, float] | None, wanted: Sequence[int] | str | None) -> str:
    """Return a key that changes with everything the file depends on: bag, report, catalogue, the code that makes it, choices."""
    rr = import_rerun()
    digest = hashlib.sha256(f"{__version__} {rr.__version__} {window} {wanted}".encode())
    package = Path(__file__).parents[1]
    sources = sorted(path for part in ("view", "analysis", "bags", "rig", "plant/parts") for path in (package / part).glob("*.py"))
    rigs = sorted((package / "rigs").glob("*/rig.yaml"))  # the page of the run lists the settings that differ from them
    for file, piece in zip(bag.files, bag.pieces, strict=True):
        digest.update(file.name.encode() + piece.digest())
    for path in (bag.files[0].parent / REPORT_FILE, *sources, *rigs):
        digest.update(path.name.encode())
        if path.exists():
            with open(path, "rb") as file:
                digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()[:24]


def _key_of(path: Path) -> str | None:
    """Return the key with which a file was made, or None for a missing or damaged file."""
    if not path.exists():
        return None
    from rerun.chunk import RrdReader

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # rerun only warns about a cut file
            return RrdReader(path).recordings()[0].recording_id
    except (OSError, ValueError, RuntimeError, IndexError, Warning):
        return None


class _Source:
    """What a view is made from: a bag's signals, events, report and moments."""

    def __init__(
        self, index: OpenedBags, run: str | Path, window: tuple[float, float] | None, wanted: Sequence[int] | str | None
    ) -> None:
        self.index, self.bag, self.window = index, run, window
        self.damaged = False  # known when the whole bag was read
        self.small = _small(index)
        self.pages = self.small.of_rig(Pages)
        self.names, self.own = _names(self.pages, index, self.small)
        self.events = self.small.events()
        self.report, self.run, self.notes = _report(self.small)
        if self.report is None:
            end, cut = index.end()
            reason = cut or (end.reason if end else NO_REPORT)
            self.run["end"] = {"state": CUT_OFF if cut else end.state if end else None, "reason": reason}
        orders = orders_in(self.events)
        offset = log_offset(self.small)
        first, last = index.main_span
        self.ends = (first - offset) / 1e9, (last - offset) / 1e9
        self.reader = Reader(index, self.pages, self.small, offset)
        at_rest = [order[0] for order in orders if self.reader.engages_at_rest(order)]
        self.orders = layout.shifts_of(orders, self.pages.box, at_rest)
        self.shifts = [one for one in self.orders if one.number]
        self.close = self._close(orders, wanted)
        own = () if wanted else self.pages.more_pages  # shifts that were asked for are shown first
        self.opens = "run" if window else next(iter((*own, *(one.page.key for one in self.close))), "run")
        self.span = self._span(wanted)
        if self.span is not None or not self._from_the_start():
            self.pages.plates = {}  # the temperature of the plates depends on all their heat since time 0

    def _span(self, wanted: Sequence[int] | str | None) -> tuple[float, float] | None:
        """Return the only part of the run to read and to show [s], or None for the whole run."""
        if self.window is not None:
            first, last = self.ends
            if self.window[0] >= last or self.window[1] <= first:
                asked = f"--window {self.window[0]:g},{self.window[1]:g}"
                raise RigError(f"{asked}: lies outside the run, which goes from {first:.2f} s to {last:.2f} s")
            return self.window
        if wanted is None or wanted == layout.ALL:
            return None
        windows = [self.shifts[number - 1].window for number in wanted]
        return min(start for start, _ in windows), max(end for _, end in windows)

    def _from_the_start(self) -> bool:
        heats = [one.heat for one in self.pages.plates.values() if one.heat in self.names]
        return all(len(t) for t, _ in self.reader.read(heats, 0.0, EARLY).values())

    def _close(self, orders: list[tuple[float, int, int]], wanted: Sequence[int] | str | None) -> list[MomentCurves]:
        """Return the curves of what is shown close up."""
        box, pages = self.pages.box, []
        if box is not None and wanted is None and not any(box.changes(before, after) for _, before, after in orders):
            pages = measured_pages(self.pages, self._measured(), self.ends)
        columns = layout.columns_of(self.shifts, wanted)
        if columns:
            chosen = [shift for column in columns for shift in column]
            ends = {order[0]: end for order, end in with_ends(orders)}
            rows = metrics_of(self.reader, chosen, ends) if self.report is None else self.report["shifts"]
            pages.insert(0, shift_page(self.pages, columns, rows))
        return [MomentCurves(self.reader, self.pages, self.names, page) for page in pages]

    def _measured(self) -> dict:
        """Return the results of a run without a change of gear; without a report beside the bag one is made."""
        if self.report is None:
            try:
                self.report = build_report(gather(self.bag, self.run, recover=True), self.run)
            except RigError:
                return {}  # the curves report the error
        return self.report.get("measured") or {}

    def tab(self, wanted: str | None) -> str:
        """Return the name of the tab to show alone; RigError when there is no tab of the wanted name."""
        there = [one.page.key for one in self.close]
        if wanted and wanted not in (tabs := (*layout.TABS, *self.pages.more_pages)):
            raise RigError(f"--tab: {unknown('tab', wanted, tabs)}")
        if wanted == "controller" and not self.own:
            raise RigError(f"{self.bag}: its controller names no signals of its own; --tab can be shifts, run or other")
        if wanted in ("shifts", "valve", "coast_down") and wanted not in there:
            has = ", ".join([*there, "run", "other"])
            raise RigError(f"{self.bag}: the run has no tab '{wanted}'; --tab can be {has}")
        return wanted or self.opens

    def blueprint(self, only: str | None, extremes: layout.Extremes) -> Blueprint:
        """Return the layout, or that of one tab alone."""
        span = self.span or self.ends
        return layout.blueprint(self.pages, set(self.names), span, only, self.own, self.close, self.opens, extremes)

    def send(self, rr: ModuleType, rec: RecordingStream) -> None:
        """Send what is shown close up, and the events."""
        for one in self.close:
            one.send(rr, rec)
        by_node: dict[str, list] = {}
        for t, topic, name, text, _ in self.events:
            by_node.setdefault(topic.strip("/").split("/")[0], []).append((t, *event_row(t, topic, name, text)))
        for node, rows in by_node.items():
            t, texts, levels = zip(*rows)
            rec.send_columns(f"events/{node}", [times(rr, t)], rr.TextLog.columns(text=texts, level=levels))


def _write(source: _Source, path: Path, key: str) -> list[str]:
    """Write the bag to the file piece by piece; return what the bag lacks, which is also shown with the report."""
    with recording(path, key) as (rr, rec):
        rec.send_recording_name(source.index.pieces[0].path.stem)
        source.send(rr, rec)
        start, end = source.span or source.ends
        first, last = layout.window_of(source.pages, source.names, (start, end))
        second = layout.column_width(2) / (last - first)
        curves = Curves(rr, rec, source.pages, source.names, source.orders, end - start > LONG, second)
        report, notes = _send_bag(source, rec, curves)
        _send_texts(rr, rec, source, report, notes)
        rec.send_blueprint(source.blueprint(None, curves.extremes))
    return notes


def _send_bag(source: _Source, rec: RecordingStream, curves: Curves) -> tuple[dict, list[str]]:
    """Send all curves; return the report, made from the bag where none was beside it, and what the bag lacks."""
    index, report = source.index, source.report
    notes: list[str] = []
    if source.span is not None:
        for piece in source.reader.pieces(*source.span):
            curves.add(piece)
            rec.flush()
        notes += index.damage
    if source.span is None or report is None:
        gathered = gathering(source.bag, source.small, source.run) if report is None else None
        held, last, numbers = 0, 0, Numbers()
        for piece in Bag.pieces(source.bag, PIECE, recover=True):
            if source.span is None:
                curves.add(piece)
                rec.flush()
            if gathered is not None:
                gathered.add(piece)
            numbers.add(piece)
            held, last = held + sum(piece.counts.values()), max(last, piece.last)
        source.damaged = bool(piece.damage)
        notes = [recovered(held, source.small.end_by(numbers, last), piece.damage)] if piece.damage else []
        notes += numbers.disorder(source.small)
        if report is None:
            report = build_report(gathered, source.run)
    curves.finish()
    if not index.counts.get(LOGGER):
        notes.append(f"no rows of the logger: the bag has no messages of {LOGGER}")
    notes += curves.problems
    lacking = [name for name in source.pages.known.signals if name not in source.names]
    if lacking and not report["run"].get("imported"):  # a measurement has no states of a plant
        notes.append(f"the bag holds nothing of {', '.join(lacking)}")
    return report, notes + source.notes


def _send_texts(rr: ModuleType, rec: RecordingStream, source: _Source, report: dict, notes: list[str]) -> None:
    """Send the report, and the page of the run."""
    for place, document in (
        ("report", report_document(report, notes)),
        ("run", run_document(report, source.small.record, source.events, notes)),
    ):
        rec.log(place, rr.TextDocument(document, media_type="text/markdown"), static=True)


def _lacks(index: OpenedBags) -> tuple[list[str], bool]:
    """Return sentences on what the view does not show of the bag, with the reasons, and True when that is cut off or damaged."""
    _, cut = index.end()
    others = index.not_of(_small(index).of_rig(Pages).known.all_topics)
    left_out = [f"not shown, as no signals of the rig come from them: {', '.join(others)}"] * bool(others)
    return [cut] * bool(cut) + index.notes + index.holes_in_time + left_out, bool(cut or index.damage)


def _small(index: OpenedBags) -> Bag:
    """Return a bag with the events, columns of loggers and description of the whole run."""
    return index.bag([topic for topic, ros_type in index.types.items() if ros_type in SMALL])


def _names(pages: Pages, index: OpenedBags, small: Bag) -> tuple[list[str], tuple[str, ...]]:
    """Return the catalogue's signals that the bag holds, and the controller's own named signals, which most runs lack."""
    logged = small.columns(LOGGER) if index.counts.get(LOGGER) else []
    own = small.columns(OWN_TOPIC) if index.counts.get(OWN_TOPIC) else []
    return [
        name
        for name, signal in pages.known.signals.items()
        if name in logged or (index.counts.get(signal.topic) and small.has_field(signal))
    ], tuple(own)


def _report(small: Bag) -> tuple[dict | None, dict, list[str]]:
    """Return the report beside the bag, the section ``run`` for a new report, and notes on problems of either.

    The report is None when it is missing or belongs to another run.
    """
    report, info, notes = None, {}, []
    try:
        report = read_report(small.path.parent)
    except RigError as error:
        notes.append(str(error))
    if report is not None and not is_of(small, report["run"]):
        notes.append(f"{REPORT_FILE} beside the bag is of another run; this one is made from the bag")
        report = None
    if report is not None and "shifts" in report:
        return report, {}, notes
    try:
        info = small.run_info()
    except RigError as error:
        notes.append(str(error))
    return None, info, notes
