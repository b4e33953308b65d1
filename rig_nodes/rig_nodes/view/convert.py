"""A bag as a Rerun file: all signals in the units people read, states, events, report and layout.

Used by `rig view`; the file is made beside the bag, and only when what it is made from has changed.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import __version__
from ..analysis.report import ORDER_EVENT, ORDERS_TOPIC, REPORT_FILE, build_report, is_of, read_report
from ..bags.reader import Bag
from ..catalogue import Signal, catalogue, kind_of_topics
from ..config import package_file
from ..errors import RigError
from . import layout
from .document import report_document

APPLICATION = "virtual_rig"
VIEW_FILE = "view.rrd"
LOGGER_TOPIC, OWN_TOPIC = "/instruments/hmg4000", "/alfa46/signals"
LEVELS = (("tripped", "ERROR"), ("failed", "ERROR"), ("e_stop", "ERROR"), ("refused", "WARN"),
          ("aborted", "WARN"))


@dataclass(frozen=True)
class View:
    """The view of a run: its file, whether it was written anew, sentences on what the bag lacks."""

    path: Path
    written: bool
    notes: list[str]


def make_view(run: str | Path, window: tuple[float, float] | None = None) -> View:
    """Write ``view.rrd`` beside the bag of a run, unless it is there and made from the same.

    run: folder of a run or its .mcap file; a cut bag is shown as far as it goes. window: start and end [s]
    that the plots open with. Raises BagError for a bag of which nothing can be read or that nothing was recorded
    into, and RigError when rerun-sdk is missing, the file cannot be written or the window lies outside the run.
    """
    bag = Bag(run, recover=True)
    bag.check_began()
    import_rerun()
    notes = [bag.recovered] if bag.recovered else []
    path = bag.path.parent / VIEW_FILE
    key = _key(bag.path, window)
    if _key_of(path) == key:
        return View(path, False, notes)
    try:
        handle, name = tempfile.mkstemp(prefix=".view-", suffix=".rrd", dir=path.parent)
    except OSError as error:
        raise RigError(f"{path}: cannot be written ({error.strerror}); "
                       f"copy the run to a folder of yours") from None
    os.close(handle)
    try:
        _write(bag, Path(name), key, window, notes)
        os.chmod(name, 0o644)  # mkstemp makes it private
        os.replace(name, path)
    except OSError as error:
        raise RigError(f"{path}: cannot be written ({error.strerror})") from None
    finally:
        Path(name).unlink(missing_ok=True)
    return View(path, True, notes)


def save_bare_layout(run: str | Path, window: tuple[float, float] | None, path: Path,
                     tab: str | None = None) -> None:
    """Write the layout of one tab of a run's view, without the viewer's own bars, for a picture of it.

    tab: one of layout.TABS, the one that the view opens with unless told otherwise; RigError when the run has none.
    """
    bag = Bag(run, recover=True)
    own = tuple(_own_signals(bag)[1])
    if tab == "controller" and not own:
        raise RigError(f"{run}: its controller names no signals of its own; --tab can be shifts, run or other")
    shifts = layout.choose(layout.shifts_of(_orders(bag.events())))
    tab = tab or ("shifts" if shifts and not window else "run")
    layout.blueprint(set(_signals(bag)[0]), shifts, window, tab, own).save(APPLICATION, path)


def import_rerun():
    """The rerun module; RigError with the way out when this environment has none."""
    try:
        import rerun
        import rerun.blueprint
        import rerun.chunk
    except (ImportError, AttributeError) as error:
        raise RigError(f"the view needs rerun-sdk (with numpy 2), which this Python lacks ({error}); use "
                       f"the environment that ./rig makes, or 'pip install rerun-sdk' in another") from None
    return rerun


def _key(bag: Path, window) -> str:
    """Changes whenever the file would: with bag, report, catalogue, the code that makes it, and window."""
    rr = import_rerun()
    digest = hashlib.sha256(f"{__version__} {rr.__version__} {window}".encode())
    package = Path(__file__).parents[1]
    sources = sorted(path for part in ("view", "analysis", "bags") for path in (package / part).glob("*.py"))
    for path in (bag, bag.parent / REPORT_FILE, package_file("signals.yaml"), *sources):
        digest.update(path.read_bytes() if path.exists() else b"none")
        digest.update(path.name.encode())
    return digest.hexdigest()[:24]


def _key_of(path: Path) -> str | None:
    """The key a file was made with, None for one that is missing or damaged."""
    if not path.exists():
        return None
    from rerun.chunk import RrdReader

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a file that is cut is only warned about
            return RrdReader(path).recordings()[0].recording_id
    except (OSError, ValueError, RuntimeError, IndexError, Warning):
        return None


def _write(bag: Bag, path: Path, key: str, window, notes: list[str]) -> None:
    """Fill the file; ``notes`` grows by what the bag lacks and is shown with the report."""
    rr = import_rerun()
    signals, lacking = _signals(bag)
    notes += lacking
    events = bag.events()
    if window is not None:
        _check_window(window, signals)
    shifts = layout.shifts_of(_orders(events))
    rec = rr.RecordingStream(APPLICATION, recording_id=key, send_properties=False)  # no wall clock
    t_own, own = _own_signals(bag)
    rec.save(path, default_blueprint=layout.blueprint(set(signals), layout.choose(shifts), window, own=tuple(own)))
    rec.send_recording_name(bag.path.stem)
    for name, (t, values) in signals.items():
        signal = catalogue().signal(name)
        (_send_states if signal.states else _send_series)(rr, rec, signal, t, values)
    for name, values in own.items():
        rec.log(layout.own_entity(name), rr.SeriesLines(names=name), static=True)
        rec.send_columns(layout.own_entity(name), [times(rr, t_own)], rr.Scalars.columns(scalars=values))
    _send_marks(rr, rec, shifts, signals)
    _send_events(rr, rec, events)
    document = report_document(_report(bag, notes), notes)
    rec.log("report", rr.TextDocument(document, media_type="text/markdown"), static=True)
    rec.flush()
    rec.disconnect()


def _signals(bag: Bag) -> tuple[dict[str, tuple[np.ndarray, np.ndarray]], list[str]]:
    """Time [s] and value [SI] of every signal the bag holds, the logger's at its rate; what is missing."""
    found, notes = {}, []
    known = catalogue(kind_of_topics(bag.counts)).signals
    try:
        logger = bag.logger(LOGGER_TOPIC, fill=True)
        t = logger.time()
        found = {name: (t, values) for name, values in logger.channels.items() if name in known}
    except RigError as error:
        notes.append(f"no rows of the logger: {error}")
    lacking = []
    for name in known:
        if name in found:
            continue
        try:
            t, values = bag.series(name)
        except RigError:
            t = ()
        if len(t):
            found[name] = (t, values)
        else:
            lacking.append(name)
    if lacking:
        notes.append(f"the bag holds nothing of {', '.join(lacking)}")
    return found, notes


def _own_signals(bag: Bag) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Time [s] and value of the signals that the controller names as its own; none in most runs."""
    if OWN_TOPIC not in bag.types:
        return np.empty(0), {}
    logger = bag.logger(OWN_TOPIC, fill=True)
    return logger.time(), logger.channels


def _orders(events) -> list[tuple[float, int, int]]:
    """Orders of the shift controller: (t [s], gear before, gear after); neutral before the first."""
    orders, before = [], 0
    for t, topic, name, _, value in events:
        if topic == ORDERS_TOPIC and name == ORDER_EVENT:
            orders.append((t, before, int(value)))
            before = int(value)
    return orders


def _check_window(window, signals) -> None:
    ends = [(t[0], t[-1]) for t, _ in signals.values()]
    first, last = min((a for a, _ in ends), default=0.0), max((b for _, b in ends), default=0.0)
    if window[0] >= last or window[1] <= first:
        raise RigError(f"--window {window[0]:g},{window[1]:g}: lies outside the run, which goes from "
                       f"{first:.2f} s to {last:.2f} s")


def _report(bag: Bag, notes: list[str]) -> dict:
    """The report beside the bag, or one made from the bag alone: also where what lies there is of another run."""
    try:
        report = read_report(bag.path.parent)
    except RigError as error:
        notes.append(str(error))
        report = None
    if report is not None and bag.began and not is_of(bag, report["run"]):
        notes.append(f"{REPORT_FILE} beside the bag is of another run; this one is made from the bag")
        report = None
    if report is None or "shifts" not in report:
        try:
            info = bag.run_info()
        except RigError as error:
            notes.append(str(error))
            info = {}
        report = build_report(bag, {**info, "end": {"reason": "the run left no report"}})
    return report


def times(rr, t: np.ndarray):
    """Times [s] as the time column of every view."""
    return rr.TimeColumn(layout.TIMELINE, duration=np.round(np.asarray(t) * 1e9).astype("timedelta64[ns]"))


def log_style(rr, rec, signal: Signal) -> None:
    """Name with unit and colour of a curve."""
    name = f"{signal.name} [{signal.display_unit}]"
    line = rr.SeriesLines(names=name, colors=layout.colour(signal.name), widths=layout.width(signal.name))
    rec.log(layout.entity(signal), line, static=True)


def log_state_styles(rr, rec, signal: Signal) -> None:
    """Labels and colours of the states of a signal."""
    labels = list(signal.states.values())
    colours = [layout.state_colour(signal.name, label) for label in labels]
    rec.log(layout.entity(signal), rr.StateConfiguration(values=labels, colors=colours), static=True)


def event_row(t: float, topic: str, name: str, text: str) -> tuple[str, str]:
    """What the list of events shows of one, and its level. t: time [s]."""
    level = next((level for part, level in LEVELS if part in name), "INFO")
    return f"{t:.3f} s  {topic.strip('/').split('/')[0]}: {text or name}", level


def _send_series(rr, rec, signal: Signal, t: np.ndarray, values: np.ndarray) -> None:
    log_style(rr, rec, signal)
    rec.send_columns(layout.entity(signal), [times(rr, t)], rr.Scalars.columns(scalars=signal.shown(values)))


def _send_states(rr, rec, signal: Signal, t: np.ndarray, values: np.ndarray) -> None:
    """One row for each change of state."""
    log_state_styles(rr, rec, signal)
    change = np.flatnonzero(np.diff(values, prepend=np.nan) != 0)
    states = [signal.states.get(int(value), str(int(value))) for value in values[change]]
    rec.send_columns(layout.entity(signal), [times(rr, t[change])], rr.StateChange.columns(state=states))


def _send_marks(rr, rec, shifts, signals) -> None:
    """An upright line at the order of each shift, as high as the curves of the plot during the shift."""
    for title, names in layout.MARKED_PLOTS:
        rows = []
        for shift in shifts:
            start, end = shift.window
            seen = [catalogue().signal(name).shown(values[(t >= start) & (t <= end)])
                    for name, (t, values) in signals.items() if name in names]
            seen = np.concatenate(seen) if seen else np.empty(0)
            seen = seen[np.isfinite(seen)]
            if len(seen):
                rows += [(shift.order, seen.min()), (shift.order, seen.max()), (shift.order, np.nan)]
        if rows:
            t, values = np.array(rows).T
            path = layout.mark_entity(title)
            # both ends lie at one time: averaged, they would be a point
            line = rr.SeriesLines(names="shift ordered", colors=layout.OTHER, widths=1.0,
                                  aggregation_policy="Off")
            rec.log(path, line, static=True)
            rec.send_columns(path, [times(rr, t)], rr.Scalars.columns(scalars=values))


def _send_events(rr, rec, events) -> None:
    by_node: dict[str, list] = {}
    for t, topic, name, text, _ in events:
        by_node.setdefault(topic.strip("/").split("/")[0], []).append((t, *event_row(t, topic, name, text)))
    for node, rows in by_node.items():
        t, texts, levels = zip(*rows)
        rec.send_columns(f"events/{node}", [times(rr, t)], rr.TextLog.columns(text=texts, level=levels))
