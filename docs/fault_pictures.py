# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which signal of a rig shows each type of fault, and the pictures by which one recognises it, drawn for the site.

made_pages.py puts them below the table of types; tests/faults/test_every_fault.py holds the rigs to the same tables.
"""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

import rig_nodes
from rig_nodes.plant import LINES
from rig_nodes.rig import faults_of, load_rig, read_fault
from rig_nodes.view import Line, chart, write_charts

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from rig_nodes.rig import RigConfig
    from rig_nodes.runs import Session
    from rig_nodes.view import Description

ON = {"faults": "on", "trips": {"watched": "off"}}  # no trip ends what is to be seen
PERIOD = 0.01  # s between two readings
HIGH = 190  # px of a plot
FOLDER = "faults"  # of the pictures, beside the page
Step = tuple[str, str, float]  # what is set, its value, and the seconds that pass then; nothing is set where the former is empty
# the signal that shows a fault, and by how much [SI] it is lower and higher at most than in the healthy run: one of the two is
# reached (the other is the largest that has nothing to do with the fault)
Sign = tuple[str, float | None, float | None]


@dataclass(frozen=True)
class Course:
    """What is done with a rig, healthy and with each fault.

    Parameters
    ----------
    text : str
        What it is, for the page.
    settled : dict of str to float
        The signals that are read, with what is allowed of each as a difference at the end [SI]: a little more than noise and a
        step of the converter.
    start, shown, after : tuple of Step
        What comes before the fault, what is seen of it, and what brings the rig back to where it was.
    signs : dict of str to Sign
        The faults.
    sizes : dict of str to str
        Sizes where the usual one does nothing here.
    settings : dict
        The rig's other changed values.
    """

    text: str
    settled: dict[str, float]
    start: tuple[Step, ...]
    shown: tuple[Step, ...]
    after: tuple[Step, ...]
    signs: dict[str, Sign]
    sizes: dict[str, str] = field(default_factory=dict)
    settings: Mapping[str, dict] = field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        """The signals that are read."""
        return list(self.settled)

    @property
    def before(self) -> float:
        """Seconds until the first thing is set, from which the time of a picture counts."""
        return self.shown[0][2]


COURSES = {
    "hydmag": Course(
        "An upshift",
        {
            "M_wej": 3.0,
            "n_wej": 0.5,
            "M_wyj": 3.0,
            "n_wyj": 0.5,
            "p1": 6e4,
            "p2": 6e4,
            "p_po": 6e4,
            "I_zr_p1": 0.02,
            "I_zr_p2": 0.02,
            "p_p": 3e4,
            "T_oil": 0.5,
        },
        (("oil", "4 MPa", 0.3), ("shift", "I", 0.0), ("motor", "500 rpm", 0.5), ("load", "30 Nm", 1.2)),
        (("", "", 0.2), ("shift", "II", 1.5)),
        (("shift", "I", 1.4),),
        {
            "motor.weak": ("n_wej", -2.0, None),
            "motor.tripping": ("n_wej", -5.0, None),
            "clutch_s2.glazed": ("n_wyj", -2.0, None),
            "clutch_s2.worn": ("n_wyj", -10.0, None),
            "clutch_s2.tight": ("n_wyj", None, 10.0),
            "clutch_s2.spring": ("n_wyj", None, 1.0),
            "clutch_s1.seized": ("n_wyj", -5.0, None),
            "clutch_s2.warped": ("n_wyj", None, 10.0),
            "clutch_s2.leaking_line": ("p2", -1e6, None),
            "clutch_s2.leaking_piston": ("p2", -1e6, None),
            "load_pump.chattering": ("p_po", -5e4, None),
            "valve_zr_p2.stuck": ("p2", -2e6, None),
            "valve_zr_p2.sticking": ("p2", -1e6, None),
            "valve_zr_p2.slow": ("p2", -1e6, None),
            "valve_zr_p1.leaking": ("p1", None, 2e6),
            "valve_zr_p2.dead_band": ("p2", -3e4, None),
            "valve_zr_p2.spring": ("p2", None, 5e5),
            "valve_zr_p2.inlet": ("p2", -2e6, None),
            "valve_zr_p2.coil_open": ("I_zr_p2", -0.5, None),
            "valve_zr_p2.coil_shorted": ("p2", -1e6, None),
            "valve_zr_p2.coil_hot": ("I_zr_p2", -5e-3, None),
            "oil_supply.air": ("p2", -8e5, None),
            "oil_supply.cold": ("T_oil", -20.0, None),
            "oil_supply.worn": ("p_p", -8e5, None),
            "n_wyj.offset": ("n_wyj", None, 15.0),
            "n_wyj.drift": ("n_wyj", None, 5.0),
            "n_wyj.gain": ("n_wyj", None, 3.0),
            "p2.noise": ("p2", -5e5, None),
            "n_wyj.stuck": ("n_wyj", -10.0, None),
            "n_wyj.dropped": ("n_wyj", -35.0, None),
            "n_wyj.loose": ("n_wyj", -35.0, None),
            "n_wyj.swapped": ("n_wyj", None, 10.0),
            "p2.delayed": ("p2", -1e6, None),
            "n_wyj.losing_pulses": ("n_wyj", -3.0, None),
            "output_2.fill_time": ("p2", -1e6, None),
            "messages.late": ("I_zr_p2", -0.3, None),
            "messages.lost": ("I_zr_p2", -0.1, None),
            "messages.doubled": ("I_zr_p2", None, 5e-4),
            "messages.corrupted": ("I_zr_p2", None, 0.03),
            "measurements.late": ("I_zr_p2", -0.3, None),
            "measurements.lost": ("I_zr_p2", -0.3, None),
            "measurements.corrupted": ("I_zr_p2", -0.02, None),
        },
        {"motor.weak": "94 %", "messages.lost": "90 %", "messages.doubled": "100 %", "measurements.lost": "90 %"},
    ),
    "clutch_bench": Course(
        "A pack that turns is clamped, and torque is raised until it slips",
        {"M_e": 3.0, "n": 0.3, "p_z": 2e4, "s": 5e-6, "p_sh": 6e4},
        (("relief", "2 MPa", 0.0), ("motor", "80 rpm", 1.0)),
        (("", "", 0.2), ("cylinder", "1.5 MPa", 0.5), ("relief", "16 MPa", 0.8)),
        (("cylinder", "0 MPa", 0.0), ("relief", "2 MPa", 2.5)),
        {
            "clutch_pack.glazed": ("M_e", -20.0, None),
            "clutch_pack.worn": ("s", None, 3e-4),
            "clutch_pack.tight": ("s", -5e-4, None),
            "clutch_pack.seized": ("n", -4.0, None),
            "clutch_pack.warped": ("s", -1e-4, None),
            "cylinder.leaking": ("p_z", -2.5e4, None),
            "cylinder.sticking": ("M_e", -10.0, None),
            "cylinder.spring": ("M_e", None, 10.0),
            "hydraulic_motor.leaking": ("n", -0.5, None),
            "hydraulic_motor.weak": ("n", None, 0.5),
            "hydraulic_motor.dragging": ("p_sh", None, 3e5),
        },
        {"clutch_pack.seized": "100 Nm"},
        {"hydraulic_motor": {"relief_rate": "20 MPa/s"}},
    ),
    "hydmag_hydrostatic": Course(
        "A load is driven faster by the hydrostatic drive",
        {"n_wej": 0.5, "n_wyj": 0.5, "M_wyj": 3.0, "p_A": 1e5, "p_B": 1e5, "swivel_p": 5e-3},
        (
            ("oil", "4 MPa", 0.2),
            ("hydraulic_motor", "100 %", 0.0),
            ("motor", "800 rpm", 1.5),
            ("load", "8 MPa", 0.2),
            ("pump", "50 %", 1.5),
        ),
        (("", "", 0.2), ("pump", "100 %", 1.5)),
        (("pump", "50 %", 2.0),),
        {
            "hydrostatic.leaking": ("n_wyj", -1.0, None),
            "hydrostatic.weak_pump": ("n_wyj", -2.0, None),
            "hydrostatic.weak_motor": ("n_wyj", None, 2.0),
            "hydrostatic.stuck": ("swivel_p", -0.3, None),
            "hydrostatic.relief": ("p_A", -1e6, None),
            "hydrostatic.boost": ("p_B", -5e5, None),
        },
    ),
    "hydmag_engine": Course(
        "The engine, without a gear, goes to a higher speed",
        {"n_wej": 1.0, "charge": 0.01, "M_wej": 3.0},
        (("oil", "4 MPa", 0.2), ("motor", "1500 rpm", 4.0)),
        (("", "", 0.2), ("motor", "2000 rpm", 1.8)),
        (("motor", "1500 rpm", 4.0),),
        {
            "motor.misfiring": ("charge", None, 0.05),
            "motor.cutting_out": ("n_wej", -3.0, None),
            "motor.weak": ("charge", None, 0.1),
            "motor.stuck": ("n_wej", -20.0, None),
        },
    ),
    "ural2": Course(
        "The saw's engine goes from idle to the speed of a cut",
        {"n_engine": 25.0, "n_drum": 25.0},
        (("motor", "3000 rpm", 2.5),),
        (("", "", 0.2), ("motor", "4500 rpm", 2.0)),
        (("motor", "3000 rpm", 3.0),),
        {"clutch.oily": ("n_drum", -20.0, None), "clutch.spring": ("n_drum", None, 50.0)},
    ),
}


def outside(fault: str) -> bool:
    """Return whether the controller stands outside the rig for a fault, as messages fail only between the two."""
    return fault.partition(".")[0] in LINES


def type_of(config: RigConfig, fault: str) -> str:
    """Return the type of a rig's fault."""
    one = faults_of(config)[fault].fault
    return f"{one.part}.{one.name}"


@contextmanager
def bench() -> Iterator[Callable[[str, bool], Session]]:
    """Yield a function that returns a session of a rig at the start of its course, with the controller inside or outside."""
    with ExitStack() as stack:

        def started(rig: str, controller: str | None) -> Session:
            course = COURSES[rig]
            session = stack.enter_context(rig_nodes.load(rig, **ON, **course.settings).session(seed=1, controller=controller))
            readings(session, course, course.start)
            return session

        inside = {}

        def begun(rig: str, controller_outside: bool = False) -> Session:
            if controller_outside:  # whose state cannot be brought back
                return started(rig, "alfa46")
            if rig not in inside:
                session = started(rig, None)
                inside[rig] = session, session.snapshot()
            session, start = inside[rig]
            session.restore(start)
            return session

        yield begun


def readings(session: Session, course: Course, steps: tuple[Step, ...]) -> np.ndarray:
    """Return the signals [SI] of a course at each PERIOD of some of its steps (n, signals)."""
    rows = []
    for key, value, seconds in steps:
        if key:
            session.set(key, value)
        for _ in range(round(seconds / PERIOD)):
            session.advance(PERIOD)
            rows.append([session.read(name) for name in course.names])
    return np.array(rows)


def shown(session: Session, course: Course, fault: str = "") -> np.ndarray:
    """Return the readings of what is shown of a course, with a fault that is there from its beginning on."""
    if fault:
        session.fault(fault, **({"size": course.sizes[fault]} if fault in course.sizes else {}))
    return readings(session, course, course.shown)


def page() -> str:
    """Return what stands below the table of types: each of them with its picture."""
    parts = []
    for rig, course in COURSES.items():
        parts.append(f"\n## Pictures: rig {rig}\n\n{course.text}, healthy and with each fault, in the signal that shows it.\n")
        config = load_rig(rig)
        known = faults_of(config)
        for name, (signal, *_) in course.signs.items():
            fault, kind = known[name].fault, type_of(config, name)
            picture = f"![{signal} with {name} and without]({FOLDER}/{_file(kind)}.svg)"
            parts.append(f"### {kind}\n\n{fault.text} One sees: {fault.sign}.\n\n{picture}\n")
    return "\n".join(parts)


def draw(folder: Path) -> list[Path]:
    """Write the picture of each type of fault into the pictures' folder in a folder and return the files."""
    return write_charts(_charts(), folder / FOLDER)


def _charts() -> Iterator[tuple[str, Description]]:
    with bench() as begun:
        for rig, course in COURSES.items():
            config = load_rig(rig)
            healthy = {
                controller: shown(begun(rig, controller), course) for controller in {outside(fault) for fault in course.signs}
            }
            for fault, (name, *_) in course.signs.items():
                ill = shown(begun(rig, outside(fault)), course, fault)
                size = read_fault(
                    config, fault + (f", size={course.sizes[fault]}" if fault in course.sizes else ""), fault
                ).shown_size
                signal, t = config.catalogue.signals[name], PERIOD * np.arange(1, len(ill) + 1) - course.before
                lines = [
                    Line(text, t, signal.shown(rows[:, course.names.index(name)]), marks=False, dashed=dashed)
                    for text, rows, dashed in ((fault, ill, False), ("healthy", healthy[outside(fault)], True))
                ]
                title = f"{fault}, {size}" if size else fault
                figure = chart(title, "time since the order [s]", f"{name} [{signal.display_unit}]", lines)
                yield _file(type_of(config, fault)), replace(figure, high=HIGH)


def _file(kind: str) -> str:
    return kind.replace(".", "_")
