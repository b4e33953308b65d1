# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of one shift in the forms of twelve loggers, with the profiles that read them."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rig_nodes.analysis.run_report import recording_of
from rig_nodes.bags.reader import Bag

SAMPLE = Path(__file__).parents[2] / "bags" / "sample"
RPM = 30.0 / np.pi
NAMES = ("M_wej", "n_wej", "M_wyj", "n_wyj", "p1", "p2")
SI = {"M_wej": ("Nm", 1.0), "n_wej": ("1/min", RPM), "M_wyj": ("Nm", 1.0), "n_wyj": ("1/min", RPM)}
SI |= dict.fromkeys(("p1", "p2"), ("bar", 1e-5))
# zero and scatter of each transducer, well within its class
ZERO = {"M_wej": 0.2, "M_wyj": -0.2, "p1": 0.01e6, "p2": -0.01e6, "n_wej": 0.0, "n_wyj": 0.0}
SCATTER = {"M_wej": 0.1, "M_wyj": 0.1, "p1": 0.005e6, "p2": 0.005e6, "n_wej": 0.01, "n_wyj": 0.01}


@functools.cache
def truth():
    bag = Bag(SAMPLE)
    return recording_of(bag, bag.transmission)


@dataclass(frozen=True)
class Laboratory:
    """A logger and the form of its files: heads of time and signals, lines around them, signs, clock and missing values."""

    heads: tuple[str, ...]
    name: str = "lab.csv"
    time: str = "t [s]"
    above: str = ""
    units: str = ""
    delimiter: str = ";"
    decimal: str = ","
    encoding: str = "utf-8"
    period: float = 2e-4
    offset: float = 0.0
    drift: float = 50e-6
    time_factor: float = 1.0
    factors: tuple[float, ...] = (1.0, RPM, 1.0, RPM, 1e-5, 1e-5)
    plus: tuple[float, ...] = (0.0,) * 6
    digits: str = "%.9g"
    of_day: bool = False  # times as 12:34:56.789000
    empty: str | None = None  # content of every 97th cell, which has no value
    dropped: int = 0  # n: every n-th row is missing
    form: str = ""  # lines of the profile for the form of the file
    mapped: tuple[str, ...] = ()  # column -> signal lines of the profile; by default heads in the order of NAMES

    def rows(self):
        """Times on the logger's clock, and values of each channel at these times, with zero and scatter."""
        own = truth().t0 + truth().period * np.arange(truth().rows)
        end = own[-1] * (1.0 + self.drift) + self.offset
        t = np.arange(own[0] + self.offset, end, self.period)
        draw = np.random.default_rng(len(self.heads[0]))
        at = (t - self.offset) / (1.0 + self.drift)
        columns = [
            (np.interp(at, own, truth().channels[one]) + ZERO[one] + SCATTER[one] * draw.standard_normal(len(t))) * factor + plus
            for one, factor, plus in zip(NAMES, self.factors, self.plus)
        ]
        return t, columns

    def write(self, folder):
        """Writes file and profile, and returns both paths."""
        t, columns = self.rows()
        table = np.column_stack([*([t * self.time_factor] if self.time else []), *columns])
        if self.dropped:
            table = np.delete(table, np.s_[:: self.dropped], axis=0)
        cells = [[self.digits % x for x in row] for row in table.tolist()]
        if self.of_day:
            for row in cells:
                row[0] = f"2026-11-24 09:15:{float(row[0]):09.6f}"
        if self.empty is not None:
            for n in range(1, len(cells) * len(NAMES), 97):
                cells[n // len(NAMES)][n % len(NAMES) + bool(self.time)] = self.empty
        lines = [self.delimiter.join(row) for row in cells]
        head = self.delimiter.join([*([self.time] if self.time else []), *self.heads])
        text = "\n".join([head, *([self.units] if self.units else []), *lines]).replace(".", self.decimal)
        text = self.above + text.replace(head.replace(".", self.decimal), head, 1)
        path, profile = folder / self.name, folder / "lab.yaml"
        path.write_bytes(text.encode(self.encoding))
        mapped = self.mapped or tuple(f'"{head}": {{signal: {one}}}' for head, one in zip(self.heads, NAMES))
        profile.write_text("\n".join(["rig: hydmag", self.form, "columns:", *(f"  {line}" for line in mapped)]), encoding="utf-8")
        return path, profile


def _german(**others):
    heads = (
        "Drehmoment Antrieb",
        "Drehzahl Antrieb",
        "Drehmoment Abtrieb",
        "Drehzahl Abtrieb",
        "Druck Kupplung 1",
        "Druck Kupplung 2",
    )
    return Laboratory(heads, time="Zeit", units="s;Nm;1/min;Nm;1/min;bar;bar", form="time: {column: Zeit, unit: s}", **others)


PLAIN = ("torque in [Nm]", "speed in [rpm]", "torque out [Nm]", "speed out [rpm]", "pressure 1 [bar]", "pressure 2 [bar]")
SECONDS = 'time: {column: "t [s]"}'
LABORATORIES = {
    "German, three lines above": _german(above="Messung;Schaltung\nPrüfstand;Süd\n", encoding="cp1252", offset=0.4321),
    "German, with empty cells": _german(empty="", offset=1.05, period=1e-4),
    "Polish, cp1250, ms": Laboratory(
        (
            "Moment wej. [Nm]",
            "Prędkość wej. [obr/min]",
            "Moment wyj. [Nm]",
            "Prędkość wyj. [obr/min]",
            "Ciśnienie S1 [MPa]",
            "Ciśnienie S2 [MPa]",
        ),
        time="Czas [ms]",
        encoding="cp1250",
        offset=0.25,
        time_factor=1e3,
        factors=(1.0, RPM, -1.0, RPM, 1e-6, 1e-6),
        form='encoding: cp1250\ntime: {column: "Czas [ms]"}',
        mapped=(
            "Moment wej.: {signal: M_wej}",
            "Prędkość wej.: {signal: n_wej}",
            "Moment wyj.: {signal: M_wyj, factor: -1}",
            "Prędkość wyj.: {signal: n_wyj}",
            "Ciśnienie S1: {signal: p1}",
            "Ciśnienie S2: {signal: p2}",
        ),
    ),
    "points and commas": Laboratory(PLAIN, delimiter=",", decimal=".", offset=2.5, form=SECONDS),
    "tabs": Laboratory(PLAIN, delimiter="\t", offset=0.1, form=f"delimiter: tab\n{SECONDS}", name="lab.txt"),
    "-999 where a value is missing": Laboratory(PLAIN, empty="-999", offset=0.7, form=f'missing: ["-999"]\n{SECONDS}'),
    "lost rows": Laboratory(PLAIN, dropped=211, offset=0.333, form=SECONDS),
    "no times": Laboratory(PLAIN, time="", form="time: {period: 0.2 ms}", digits="%.7g"),
    "before time 0": Laboratory(PLAIN, offset=-0.5, form=SECONDS),
    "volts": Laboratory(
        tuple(f"AI{n}" for n in range(6)),
        offset=0.05,
        factors=(0.02, RPM / 300.0, 0.02, RPM / 300.0, 2.5e-7, 2.5e-7),
        form=SECONDS,
        mapped=(
            "AI0: {signal: M_wej, unit: Nm, factor: 50}",
            "AI1: {signal: n_wej, unit: rpm, factor: 300}",
            "AI2: {signal: M_wyj, unit: Nm, factor: 50}",
            "AI3: {signal: n_wyj, unit: rpm, factor: 300}",
            "AI4: {signal: p1, unit: MPa, factor: 4}",
            "AI5: {signal: p2, unit: MPa, factor: 4}",
        ),
    ),
    "absolute pressures in kPa at 2 kHz": Laboratory(
        (*PLAIN[:4], "pressure 1 [kPa]", "pressure 2 [kPa]"),
        period=5e-4,
        offset=0.2,
        factors=(1.0, RPM, 1.0, RPM, 1e-3, 1e-3),
        plus=(0.0, 0.0, 0.0, 0.0, 101.325, 101.325),
        form=SECONDS,
        mapped=(
            *(f'"{head}": {{signal: {one}}}' for head, one in zip(PLAIN, NAMES[:4])),
            *(f'"pressure {n} [kPa]": {{signal: p{n}, offset: -101.325}}' for n in (1, 2)),
        ),
    ),
    "times of day, UTF-16": Laboratory(
        PLAIN, encoding="utf-16", offset=0.8, of_day=True, form='time: {column: "t [s]"}', digits="%.8g"
    ),
}
