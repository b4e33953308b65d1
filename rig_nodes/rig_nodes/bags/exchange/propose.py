# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writes a first profile for a logger's file: the form of the file, and the probable signal of each column.

`rig import` uses it when no profile is given. The guesses rest on units, sides and numbers of clutches in English, German and
Polish heads; an uncertain line is a comment in the profile.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from itertools import pairwise

from ...base import UNITS, RigError, quoted
from ...rig import Signal, Transmission, catalogue, transmission_of
from .foreign import Channel, Foreign, Form
from .imported import ORDER_NAMES
from .profile import OPEN
from .stamps import unit_of_numbers
from .time_columns import Times, found_times, unit_of_times
from .units import unit_of

# beginnings of words in heads
INPUT = ("input", "in", "eingang", "antrieb", "an", "wej", "wejś", "wejs", "motor", "silnik")
OUTPUT = ("output", "out", "ausgang", "abtrieb", "ab", "wyj", "wyjś", "wyjs", "load", "last", "obciąż", "obciaz")
LOAD = ("load", "last", "obciąż", "obciaz", "pumpe", "pump", "pomp")
SUPPLY = ("supply", "versorgung", "zasil", "system")
GEAR = ("gear", "gang", "bieg")
OIL = ("oil", "öl", "oel", "olej", "oiltemp", "öltemp", "oeltemp", "öldruck", "oeldruck")
ENGAGED = ("ist", "actual", "current", "engaged", "aktuell", "aktual")
# what is no measured value of the rig's own places
ELSEWHERE = ("soll", "set", "setpoint", "target", "command", "demand", "reference", "zadan", "tank", "return", "rücklauf", "powrót")
_WORDS = re.compile(r"[^\W\d_]+|\d+")
ROMAN = ("i", "ii", "iii", "iv", "v", "vi")


def proposed(foreign: Foreign, record: Mapping, rig: str) -> tuple[str, list[str]]:
    """Return the text of a profile, and the heads of columns for which no signal was found.

    Parameters
    ----------
    foreign : Foreign
        The file.
    record : mapping
        Record of the rig.
    rig : str
        Name of the rig for the profile.

    Returns
    -------
    (str, list of str)
        The profile and the columns that are only comments in it.
    """
    signals = catalogue(record).signals
    measured = [one for one in signals.values() if one.name in {t["name"] for t in record["structure"]["transducers"]}]
    box = transmission_of(record) if record["structure"]["gears"] else None
    times = found_times(foreign.channels)
    clocks = times.all()
    gear = _first(foreign, lambda one: one.name in ORDER_NAMES) or _first(foreign, _may_order)
    best: dict[str, Signal] = {}
    for one in foreign.channels:
        if not any(one is other for other in (*clocks, gear)) and one.kind == "numbers" and (found := _guess(one, measured, box)):
            best[one.head] = found
    guesses = [signal.name for signal in best.values()]
    lines = [
        f"# How {foreign.path.name} and files like it are read; a guess, so look at each line.",
        f"# Then: ./rig import {quoted(foreign.path.name)} --profile THIS_FILE --out runs/NAME",
        f"rig: {rig}  # its inertias, ratios and instrument errors enter the results; `./rig list rigs`",
        "# set: {w0.inertia: 0.8 kg m2}  # values of that rig that are others",
        "",
    ]
    lines += _form_lines(foreign.form)
    lines += _time_lines(foreign, times)
    lines.append("# bridge: 2 ms  # gaps up to this become straight lines")
    if box:
        if gear is not None:
            names = ", ".join(f"{number}: {name}" for number, name in box.names.items())
            lines.append(f"gear: {{column: {_quoted(gear.head)}}}  # the ordered gear; other numbers or names: values: {{{names}}}")
        else:
            first, second = list(box.ways())[:2]
            lines.append(f'# orders: "3.845:{first}, 8.32:{second}"  # when (s) which gear was ordered')
    lines += [
        "",
        "# each column: signal of the rig, unit in the file; value * factor + offset, e.g. factor: -1 for another sign",
        "columns:",
    ]
    unsure = []
    for one in foreign.channels:
        if any(one is other for other in (*clocks, gear)):
            continue
        if one.kind != "numbers":
            lines.append(f"  # {_quoted(one.head)}: {one.kind}{_first_texts(one)}")
            continue
        signal, unit = best.get(one.head), unit_of(one.unit) or ""
        if signal is not None and guesses.count(signal.name) == 1:
            unit_text = unit or OPEN  # a unit is never invented, as no period is
            doubt = _doubt(one) or ("" if unit else f"  # the file has {one.unit or 'no unit'}: is it {signal.display_unit}?")
            own = times.own.get(one.head)
            clock = f", time: {_quoted(own.head)}" if own is not None and own is not times.main else ""
            lines.append(f"  {_quoted(one.head)}: {{signal: {signal.name}, unit: {_quoted(unit_text)}{clock}}}{doubt}")
        else:
            unsure.append(one.head)
            could = [s.name for s in measured if not unit or UNITS[s.display_unit][0] == UNITS[unit][0]]
            hint = f"one of {', '.join(could)}" if could else "no signal of the rig has this unit"
            lines.append(f"  # {_quoted(one.head)}: {{signal: ?, unit: {_quoted(unit or '?')}}}  # {hint}")
    return "\n".join(lines) + "\n", unsure


def _form_lines(form: Form) -> list[str]:
    """Return the lines on the form of a text file, or on the sheet of a workbook."""
    lines = []
    if form.delimiter:
        lines += [
            f"delimiter: {_quoted('tab' if form.delimiter == chr(9) else form.delimiter)}",
            f"decimal: {_quoted(form.decimal)}" if form.decimal else 'decimal: "?"  # the file leaves it open: "," or "."?',
            *([f"thousands: {_quoted(form.thousands)}"] if form.thousands else []),
            f"header: {form.header}  # line of the names, from 1",
            *([f"units: {form.units}  # line of the units"] if form.units else []),
            f"data: {form.data}  # line of the first values",
            "# encoding: cp1250  # when letters come out wrong",
            '# missing: ["-999"]  # what stands where a value is missing, beside an empty cell, nan and ---',
        ]
    if form.sheet is not None:
        lines.append(f"sheet: {_quoted(form.sheet)}")
    return lines


def _time_lines(foreign: Foreign, times: Times) -> list[str]:
    """Return the line of the times; a period is proposed only when the file states one."""
    if times.main is not None:
        unit = f", unit: {_time_unit(times.main)}" if times.main.kind == "numbers" else ""
        date = f", date: {_quoted(times.date.head)}" if times.date else ""
        return [f"time: {{column: {_quoted(times.main.head)}{unit}{date}}}"]
    if any(one.times is not None for one in foreign.channels):
        return []
    if foreign.period is not None:
        return [f"time: {{period: {foreign.period[0] * 1e3:.9g} ms}}  # from {foreign.period[1]}"]
    return ['time: {period: "?"}  # no column holds times: write the time between rows, e.g. 0.1 ms, or column: NAME, unit: ms']


def _time_unit(channel: Channel) -> str:
    known = channel.values[channel.values == channel.values]
    return unit_of_times(channel) or (unit_of_numbers(known) if len(known) else "s")


def _doubt(channel: Channel) -> str:
    """Return the remark on a column of which a cell is no number, or one with two readings."""
    try:
        return "" if channel.values.size else "  # it is empty"
    except RigError as error:
        return f"  # {str(error).partition(': ')[2]}"


def _first_texts(channel: Channel) -> str:
    try:
        texts = list(dict.fromkeys(filter(None, channel.texts())))[:4]
    except RigError:
        return ", which cannot be used"
    return f", {', '.join(map(repr, texts))}" if texts else ""


def _quoted(text: str | None) -> str:
    return json.dumps(text or "", ensure_ascii=False)


def _first(foreign: Foreign, which: object) -> Channel | None:
    return next((one for one in foreign.channels if callable(which) and which(one)), None)


def _mentions(head: str, words: tuple[str, ...]) -> bool:
    """Return True when a word of the head is one of ``words``, or begins with one of them that has more than three letters."""
    head_words = [word.lower() for word in _WORDS.findall(head)]
    return any(word == other or (len(other) > 3 and word.startswith(other)) for word in head_words for other in words)


def _may_order(one: Channel) -> bool:
    """Return True when a column may hold the ordered gear: a time of a shift and the gear that is in are something else."""
    return _mentions(one.name, GEAR) and unit_of(one.unit or "-") == "-" and not _mentions(one.name, (*ENGAGED, "wechselzeit"))


def _guess(one: Channel, measured: list[Signal], box: Transmission | None) -> Signal | None:
    """Return the signal that a head most probably means; None when two signals are equally probable, or the head names none."""
    unit = unit_of(one.unit)
    for signal in measured:
        if one.name == signal.name and (unit is None or UNITS[unit][0] == UNITS[signal.display_unit][0]):
            return signal
    if unit is None or _mentions(one.name, ELSEWHERE):
        return None
    could = [signal for signal in measured if UNITS[signal.display_unit][0] == UNITS[unit][0]]
    marks = {signal.name: _mark(one.name, signal, box) for signal in could}
    ranked = sorted(marks.values(), reverse=True)
    if not ranked or ranked[0] <= 0 or (len(ranked) > 1 and ranked[0] == ranked[1]):
        return None
    return next(signal for signal in could if marks[signal.name] == ranked[0])


def _mark(head: str, signal: Signal, box: Transmission | None) -> int:
    head_words = [word.lower() for word in _WORDS.findall(head)]
    own_words = [word.lower() for word in _WORDS.findall(signal.name)]
    marks = 4 * any(head_words[n : n + len(own_words)] == own_words for n in range(len(head_words)))
    device = signal.topic.split("/")[1]
    if box is not None and signal.name in (box.input.torque, box.input.speed):
        return marks + 3 * _mentions(head, INPUT) - 3 * _mentions(head, OUTPUT)
    if box is not None and signal.name in (box.output.torque, box.output.speed):
        return marks + 3 * _mentions(head, OUTPUT) - 3 * _mentions(head, INPUT)
    for number, clutch in enumerate(box.clutches if box else (), 1):
        if signal.name in (clutch.pressure, clutch.current):
            names = {clutch.name.lower(), clutch.key.lower()}
            own = str(number) in head_words or (ROMAN[number - 1] in head_words if number <= len(ROMAN) else False)
            return marks + 3 * own + 3 * bool(names & {a + b for a, b in pairwise(head_words)} | names & set(head_words))
    marks += 3 * (_mentions(head, LOAD) and "load" in device) + 3 * (_mentions(head, SUPPLY) and "supply" in device)
    return marks + 2 * (_mentions(head, OIL) and "oil" in device)
