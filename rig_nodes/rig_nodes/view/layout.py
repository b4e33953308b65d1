# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a view shows: colour of every signal, plots, tabs and the window in time they open with.

Used by view.convert for a recorded run, by view.live for a running rig and by view.other_tools for layouts of
other programs; names and units come from the signal catalogue.
"""

from __future__ import annotations

import uuid
from dataclasses import dataclass

from ..catalogue import GEARBOX, Signal, catalogue
from ..transmission import transmission_of

TIMELINE = "t"
BEFORE, AFTER = 0.2, 1.5  # s around the order of a shift: profiles, torque peak and the torque settling again

LEGEND = 0.3  # of a window, shown after it: there the legend covers nothing that matters

# One hue per place of measurement, apart for the colour-blind and on dark and light ground alike:
# input shaft green, output shaft pink, the first clutch blue, the second orange, a third violet. Bright is measured,
# pale is what was asked for or could be transmitted.
INPUT, OUTPUT = (0x12, 0xB8, 0x86), (0xE0, 0x7A, 0xC0)
S1, S2, S3 = (0x2F, 0x95, 0xF5), (0xF5, 0x84, 0x1F), (0x8E, 0x6B, 0xE8)
INPUT_PALE, OUTPUT_PALE = (0x8C, 0xD9, 0xC0), (0xEF, 0xBE, 0xE0)
S1_PALE, S2_PALE, S3_PALE = (0x9B, 0xCB, 0xF8), (0xF8, 0xC4, 0x94), (0xC9, 0xB8, 0xF4)
HUES = ((S1, S1_PALE), (S2, S2_PALE), (S3, S3_PALE))  # bright and pale, of clutches and of gears, each in their order
PALE = (INPUT_PALE, OUTPUT_PALE, *(pale for _, pale in HUES))
SUPPLY, OTHER = (0xD8, 0xD0, 0x48), (0x9A, 0xA0, 0xA8)

BOX = transmission_of()
CLUTCHES = BOX.clutches


def hues(place: int) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    """Bright and pale of the clutch or gear at a place; further ones begin anew."""
    return HUES[place % len(HUES)]


def _of_clutches() -> dict[str, tuple[int, int, int]]:
    found = {}
    for place, clutch in enumerate(CLUTCHES):
        bright, pale = hues(place)
        measured = (*map(clutch.signal, ("torque", "slip", "clamp", "piston")),
                    *map(clutch.valve_signal, ("duty", "flow")))
        found |= dict.fromkeys((clutch.pressure, clutch.current, *measured), bright)
        found |= {clutch.setpoint: pale, clutch.signal("capacity"): pale}
    return found


def each(*signals) -> tuple[str, ...]:
    """Signals of the first clutch, then those of the next; each is what a clutch is asked for."""
    return tuple(of(clutch) for clutch in CLUTCHES for of in signals)


COLOURS = {
    BOX.input.torque: INPUT, BOX.input.speed: INPUT, "motor_torque": INPUT_PALE, "motor_speed_setpoint": INPUT_PALE,
    "motor_work": INPUT, "loss_in": INPUT,
    BOX.output.torque: OUTPUT, BOX.output.speed: OUTPUT, "load_torque": OUTPUT_PALE, "load_work": OUTPUT,
    "loss_out": OUTPUT, "p_po": OUTPUT, "relief_setting": OUTPUT_PALE,
    **_of_clutches(),
    "p_p": SUPPLY, "T_oil": SUPPLY,
    # the clutch bench: what turns green, what clamps blue
    "M_e": INPUT, "n": INPUT, "p_sh": INPUT, "motor_sh_torque": INPUT_PALE, "motor_sh_setpoint": INPUT_PALE,
    "motor_sh_speed": INPUT, "motor_sh_work": INPUT,
    "p_z": S1, "s": S1, "pack_clamp": S1, "F_ps": S2, "pack_torque": S2, "pack_capacity": S1_PALE, "pack_slip": S1,
    "pack_heat": S1, "cylinder_setting": S1_PALE, "T_emp": SUPPLY,
}
# Clutches go from grey over yellow to their hue, which is that of the gear at the same place.
IDLE, WAITING, ALARM = (0x55, 0x5B, 0x63), (0xC9, 0xB4, 0x2B), (0xD6, 0x45, 0x50)
STATE_COLOURS = {
    "none": IDLE, "neutral": IDLE, "open": IDLE, "starting": IDLE, "slipping": WAITING, "tie-up": ALARM,
    "ready": WAITING, "running": INPUT, "tripped": ALARM,
    **{BOX.names[gear]: hues(place)[0] for place, gear in enumerate(BOX.ratios)},
}
LOCKED = {**{clutch.signal("mode"): hues(place)[0] for place, clutch in enumerate(CLUTCHES)}, "pack_mode": S1}

SHIFT_STATES = ("gear_ordered", "gear", *(clutch.signal("mode") for clutch in CLUTCHES))
STATES = ("rig_state", *SHIFT_STATES)
PRESSURES, SLIPS = each(lambda clutch: clutch.pressure), each(lambda clutch: clutch.signal("slip"))
# title of a plot and its signals; all signals of one plot share their display unit
SHIFT_PLOTS = (
    ("Coil current", each(lambda clutch: clutch.current, lambda clutch: clutch.setpoint)),
    ("Clutch pressure", PRESSURES),
    ("Shaft torque", (BOX.input.torque, BOX.output.torque)),
    ("Clutch torque", each(lambda clutch: clutch.signal("torque"), lambda clutch: clutch.signal("capacity"))),
    ("Speed", (BOX.input.speed, BOX.output.speed, *SLIPS)),
)
RUN_LEFT = (
    SHIFT_PLOTS[0],
    ("Clutch and supply pressure", (*PRESSURES, "p_p")),
    ("Piston position", each(lambda clutch: clutch.signal("piston"))),
    ("Oil flow to the clutches", each(lambda clutch: clutch.valve_signal("flow"))),
)
RUN_RIGHT = (
    ("Shaft, motor and load torque", (BOX.input.torque, BOX.output.torque, "motor_torque", "load_torque")),
    SHIFT_PLOTS[3],
    ("Shaft speed", (BOX.input.speed, BOX.output.speed, "motor_speed_setpoint")),
    ("Slip", SLIPS),
)

# of a run of the clutch bench, which has none of the others
BENCH_STATES = ("pack_mode",)
BENCH_LEFT = (
    ("Torque of meter, motor and pack", ("M_e", "motor_sh_torque", "pack_torque", "pack_capacity")),
    ("Speed of the clutch shaft", ("n", "motor_sh_setpoint")),
    ("Pressure before the motor", ("p_sh",)),
)
BENCH_RIGHT = (
    ("Pressure in the cylinder", ("p_z", "cylinder_setting")),
    ("Travel of the piston", ("s",)),
    ("Clamp force", ("pack_clamp", "F_ps")),
)

MARKED_PLOTS = tuple(dict.fromkeys(SHIFT_PLOTS + RUN_LEFT + RUN_RIGHT))
# what people call the plots of the other signals, which are gathered by quantity
OTHER_TITLES = {"torque": "Gearbox losses", "pressure": "Load pressure", "energy": "Work since time 0",
                "force": "Clamp force", "ratio": "Valve duty", "temperature": "Oil temperature"}
TABS = ("shifts", "run", "other", "controller")  # as the command line names them

# The viewer keeps the range that linked time axes share under this fixed view id. The view with this id hands
# it the window the linked plots open with; without it they would open with the whole run.
SHARED_AXIS = uuid.UUID("5c0dca6a-e63f-9cf7-f657-2602590474cc")


@dataclass(frozen=True)
class Shift:
    """A shift to be shown: time of its order [s], gear before and after, end of its window [s]."""

    order: float
    before: int
    after: int
    end: float

    @property
    def window(self) -> tuple[float, float]:
        """Start and end of the window [s]."""
        return self.order - BEFORE, self.end

    @property
    def title(self) -> str:
        """What people call it, e.g. ``I → II at 3.835 s``."""
        names = BOX.names
        return f"{names.get(self.before, '?')} → {names.get(self.after, '?')} at {self.order:.3f} s"


def shifts_of(orders: list[tuple[float, int, int]]) -> list[Shift]:
    """The shifts of a run; the window of each ends before the next one's.

    orders: (t [s], gear before, gear after) of every order.
    """
    shifts = []
    for i, (t, before, after) in enumerate(orders):
        limit = orders[i + 1][0] - BEFORE if i + 1 < len(orders) else float("inf")
        shifts.append(Shift(t, before, after, max(min(t + AFTER, limit), t + BEFORE)))
    return shifts


def with_room(window: tuple[float, float]) -> tuple[float, float]:
    """The window that plots open with, so that their legends lie behind what is to be seen [s]."""
    start, end = window
    return start, end + LEGEND * (end - start)


def choose(shifts: list[Shift]) -> list[Shift]:
    """The first upshift and the first downshift under way, at most two, in order of time.

    Engaging from neutral is chosen only when there is nothing else.
    """
    under_way = [s for s in shifts if BOX.changes(s.before, s.after)] or shifts
    first = {}
    for shift in under_way:
        first.setdefault(shift.after > shift.before, shift)
    return sorted(first.values(), key=lambda s: s.order)


def entity(signal: Signal) -> str:
    """Where a signal lies in the view's file: its quantity, then its name, e.g. ``torque/M_wej``."""
    return f"{signal.quantity.replace(' ', '_')}/{signal.name}"


def colour(name: str) -> tuple[int, int, int]:
    """Colour of a signal, the same in every plot."""
    return COLOURS.get(name, OTHER)


def width(name: str) -> float:
    """Width of a curve in pixels: what was asked for is seen on both sides of what was measured.

    The viewer draws in the order of names: motor_torque would hide M_wej, so it is thin. A drive that holds its speed
    within a step of the encoder leaves of its setpoint the edges alone.
    """
    if name == "motor_torque":
        return 1.0
    if name == "motor_speed_setpoint":
        return 6.0
    return 4.0 if colour(name) in PALE else 2.0


def state_colour(name: str, label: str) -> tuple[int, int, int]:
    """Colour of a state of a signal."""
    return LOCKED[name] if label == "locked" else STATE_COLOURS.get(label, OTHER)


def mark_entity(title: str) -> str:
    """Where the marks of the orders in a plot lie, e.g. ``orders/shaft_torque``."""
    return f"orders/{title.lower().replace(',', '').replace(' ', '_')}"


def own_entity(name: str) -> str:
    """Where a signal of the controller's own is in the file."""
    return f"controller/{name}"


def blueprint(present: set[str], shifts: list[Shift], window: tuple[float, float] | None,
              only: str | None = None, own: tuple[str, ...] = ()):
    """The layout of a recorded run as a Rerun blueprint.

    present: names of the signals the file holds; plots without any are left out. shifts: shown side by side
    in the first tab. window: start and end [s] the linked plots open with, whose tab then shows; without it
    they open with the time of the shifts, or with the whole run when there is none. only: this one of TABS
    alone and without the viewer's own bars, for a picture; a tab that the run does not have is the run's. own: names
    of the signals of the controller's own, a plot each in a tab of theirs.
    """
    import rerun.blueprint as rrb

    span = window or (with_room((shifts[0].window[0], shifts[-1].window[1])) if shifts else None)
    axis = rrb.TimeAxis(link="LinkToGlobal")
    run, rest = _run_columns(present, axis), _rest(present, axis)
    shown = rest if only == "other" else [view for column in run for view in column] + rest
    if shown:
        shown[0].id = SHARED_AXIS
        if span is not None:
            shown[0].properties["TimeAxis"] = rrb.TimeAxis(link="LinkToGlobal", view_range=_range(span))
    tabs = {}
    if shifts:
        columns = [_shift_column(present, shift, shift is shifts[0]) for shift in shifts]
        tabs["shifts"] = _tab("Shifts", columns)
    tabs["run"] = _tab("Run", run)
    if rest:
        tabs["other"] = rrb.Grid(*rest, name="Other signals")
    if own:
        views = [rrb.TimeSeriesView(name=name, origin=own_entity(name), axis_x=axis) for name in own]
        tabs["controller"] = rrb.Grid(*views, name="Controller")
    if only is not None:
        return _whole(rrb, tabs.get(only, tabs["run"]), "hidden", "hidden", "paused")
    active = 1 if window and shifts else 0
    return _whole(rrb, rrb.Tabs(*tabs.values(), active_tab=active), "collapsed", "expanded", "paused")


def live_blueprint(seconds: float):
    """The layout of a running rig: the run's plots of all signals, over the newest ``seconds``."""
    import rerun as rr
    import rerun.blueprint as rrb

    newest = rr.TimeRangeBoundary.cursor_relative
    # linked axes have no window that moves, so each plot has its own
    span = rr.TimeRange(start=newest(seconds=-seconds), end=newest())
    axis = rrb.TimeAxis(link="Independent", view_range=span)
    present = set(catalogue().signals)
    run, rest = _run_columns(present, axis), _rest(present, axis)
    for view in [view for column in run for view in column] + rest:
        if isinstance(view, rrb.TimeSeriesView):
            view.properties["PlotLegend"] = rrb.PlotLegend("LeftTop")  # away from the newest values
    tabs = [_tab("Run", run), rrb.Grid(*rest, name="Other signals")]
    return _whole(rrb, rrb.Tabs(*tabs, active_tab=0), "collapsed", "expanded", "following")


def _whole(rrb, content, panels: str, top: str, play: str):
    return rrb.Blueprint(
        content,
        rrb.TopPanel(state=top),
        rrb.TimePanel(state=panels, timeline=TIMELINE, play_state=play),
        rrb.BlueprintPanel(state=panels),
        rrb.SelectionPanel(state=panels))


def _tab(name: str, columns: list[list]):
    """Columns of plots, and the texts at their right."""
    import rerun.blueprint as rrb

    parts = []
    for views in columns:
        if views:
            # a lane of states needs a fifth of the height of a plot
            shares = [0.25 + 0.2 * len(view.contents) if isinstance(view, rrb.StateTimelineView) else 1.0
                      for view in views]
            parts.append(rrb.Vertical(*views, row_shares=shares))
    # the text holds the time: the viewer's own column is too narrow for it
    log = rrb.archetypes.TextLogColumns(
        timeline_columns=[rrb.encodings.TimelineColumn(TIMELINE, visible=False)],
        text_log_columns=[rrb.encodings.TextLogColumn("Body")])
    texts = rrb.Vertical(rrb.TextDocumentView(name="Report", origin="/report"),
                         rrb.TextLogView(name="Events", origin="/events", columns=log), row_shares=[3, 2])
    return rrb.Horizontal(*parts, texts, column_shares=[5.0] * len(parts) + [2.7], name=name)


def _shift_column(present: set[str], shift: Shift, legend: bool) -> list:
    """Plots of one shift. legend: shown in the first column only; colours are the same in the second."""
    import rerun.blueprint as rrb

    axis = rrb.TimeAxis(link="Independent", view_range=_range(with_room(shift.window)))
    states = _states(present, shift.title, SHIFT_STATES, axis)
    return states + _plots(present, SHIFT_PLOTS, axis, legend)


def _run_columns(present: set[str], axis) -> list[list]:
    left = _states(present, "States", STATES + BENCH_STATES, axis) + _plots(present, RUN_LEFT + BENCH_LEFT, axis)
    return [left, _plots(present, RUN_RIGHT + BENCH_RIGHT, axis)]


def other_plots(kind: str = GEARBOX) -> list[tuple[str, list[str]]]:
    """Title and signals of the plots of every signal of a kind of rig that the other tabs do not show, by quantity."""
    shown = {name for _, names in MARKED_PLOTS + BENCH_LEFT + BENCH_RIGHT for name in names}
    groups: dict[str, list[str]] = {}
    for signal in catalogue(kind).signals.values():
        if signal.name not in shown and not signal.states:
            groups.setdefault(signal.quantity, []).append(signal.name)
    return [(OTHER_TITLES.get(quantity, quantity.capitalize()), names) for quantity, names in groups.items()]


def _rest(present: set[str], axis) -> list:
    # the residual is a signal of every kind
    known = catalogue()
    kind = next((kind for kind, other in known.others.items() if present & (set(other.signals) - set(known.signals))),
                GEARBOX)
    return _plots(present, other_plots(kind), axis)


def _states(present: set[str], title: str, names, axis) -> list:
    import rerun.blueprint as rrb

    contents = _contents(present, names)
    if not contents:
        return []
    return [rrb.StateTimelineView(name=title, origin="/", contents=contents, time_view=axis)]


def _plots(present: set[str], plots, axis, legend: bool = True) -> list:
    import rerun.blueprint as rrb

    views = []
    for title, names in plots:
        contents = _contents(present, names)
        if contents:
            contents.append("/" + mark_entity(title))
            unit = catalogue().signal(names[0]).display_unit
            views.append(rrb.TimeSeriesView(
                name=f"{title} [{unit}]", origin="/", contents=contents, axis_x=axis,
                plot_legend=rrb.PlotLegend("RightTop", visible=legend)))
    return views


def _contents(present: set[str], names) -> list[str]:
    return ["/" + entity(catalogue().signal(name)) for name in names if name in present]


def _range(window: tuple[float, float]):
    import rerun as rr

    start, end = (rr.TimeRangeBoundary.absolute(seconds=t) for t in window)
    return rr.TimeRange(start=start, end=end)
