# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which signal of the two-speed gearbox shows each fault, and the pictures by which one recognises it, drawn for the site.

made_pages.py puts them below the table of types; tests/faults/test_every_fault.py holds the rig to the same table.
"""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

import rig_nodes
from rig_nodes.plant import LINES
from rig_nodes.rig import faults_of, load_rig, read_fault
from rig_nodes.view import Line, chart, write_charts

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from rig_nodes.runs import Session
    from rig_nodes.view import Description

RIG, ON = "hydmag", {"faults": "on", "trips": {"watched": "off"}}  # no trip ends what is to be seen
CHANNELS = ("M_wej", "n_wej", "M_wyj", "n_wyj", "p1", "p2", "p_po", "I_zr_p1", "I_zr_p2", "p_p", "T_oil")
PERIOD, BEFORE, AFTER = 0.01, 0.2, 1.5  # s: between two readings, and of an upshift that is shown around its order
HIGH = 190  # px of a plot
FOLDER = "faults"  # of the pictures, beside the page
# fault -> the signal that shows it during an upshift, and by how much [SI] it is lower and higher at most than in the healthy run:
# one of the two is reached (the other is the largest that has nothing to do with the fault)
SIGNS: dict[str, tuple[str, float | None, float | None]] = {
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
}
SIZES = {  # where the usual size does nothing in this shift
    "motor.weak": "94 %",
    "messages.lost": "90 %",
    "messages.doubled": "100 %",
    "measurements.lost": "90 %",
}


def outside(fault: str) -> bool:
    """Return whether the controller stands outside the rig for a fault, as messages fail only between the two."""
    return fault.partition(".")[0] in LINES


@contextmanager
def bench() -> Iterator[Callable[[bool], Session]]:
    """Yield a function that returns a session in gear I under load, always the same, with the controller inside or outside."""
    with ExitStack() as stack:

        def started(controller: str | None) -> Session:
            session = stack.enter_context(rig_nodes.load(RIG, **ON).session(seed=1, controller=controller))
            session.set("oil", "4 MPa")
            session.advance(0.3)
            session.set("shift", "I")
            session.set("motor", "500 rpm")
            session.advance(0.5)
            session.set("load", "30 Nm")
            session.advance(1.2)
            return session

        inside = started(None)
        start = inside.snapshot()

        def begun(controller_outside: bool) -> Session:
            if controller_outside:  # whose state cannot be brought back
                return started("alfa46")
            inside.restore(start)
            return inside

        yield begun


def upshift(session: Session, fault: str = "") -> np.ndarray:
    """Return the CHANNELS [SI] at each PERIOD of an upshift (n, channels), with a fault that is there from its beginning on."""
    if fault:
        session.fault(fault, **({"size": SIZES[fault]} if fault in SIZES else {}))
    return np.concatenate([readings(session, BEFORE), readings(session, AFTER, "II")])


def readings(session: Session, seconds: float, gear: str = "") -> np.ndarray:
    """Return the CHANNELS [SI] at each PERIOD of a time [s] (n, channels), at whose beginning a gear may be ordered."""
    if gear:
        session.set("shift", gear)
    rows = []
    for _ in range(round(seconds / PERIOD)):
        session.advance(PERIOD)
        rows.append([session.read(name) for name in CHANNELS])
    return np.array(rows)


def page() -> str:
    """Return what stands below the table of types: each fault of SIGNS with its picture."""
    known = faults_of(load_rig(RIG))
    parts = [f"\n## Pictures\n\nAn upshift of the rig {RIG}, healthy and with each fault, in the signal that shows it.\n"]
    for name, (signal, *_) in SIGNS.items():
        fault = known[name].fault
        picture = f"![{signal} with {name} and without]({FOLDER}/{_file(name)}.svg)"
        parts.append(f"### {fault.part}.{fault.name}\n\n{fault.text} One sees: {fault.sign}.\n\n{picture}\n")
    return "\n".join(parts)


def draw(folder: Path) -> list[Path]:
    """Write the picture of each fault of SIGNS into the pictures' folder in a folder and return the files."""
    return write_charts(_charts(), folder / FOLDER)


def _charts() -> Iterator[tuple[str, Description]]:
    config = load_rig(RIG)
    with bench() as begun:
        healthy = {controller: upshift(begun(controller)) for controller in (False, True)}
        for fault, (name, *_) in SIGNS.items():
            ill = upshift(begun(outside(fault)), fault)
            size = read_fault(config, fault + (f", size={SIZES[fault]}" if fault in SIZES else ""), fault).shown_size
            signal, t = config.catalogue.signals[name], PERIOD * np.arange(1, len(ill) + 1) - BEFORE
            lines = [
                Line(text, t, signal.shown(rows[:, CHANNELS.index(name)]), marks=False, dashed=dashed)
                for text, rows, dashed in ((fault, ill, False), ("healthy", healthy[outside(fault)], True))
            ]
            title = f"{fault}, {size}" if size else fault
            figure = chart(title, "time since the order [s]", f"{name} [{signal.display_unit}]", lines)
            yield _file(fault), replace(figure, high=HIGH)


def _file(fault: str) -> str:
    return fault.replace(".", "_")
