# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Makes text of what an FMU of FMI 2.0 sends to its logger, a printf format and its values, without trusting them.

controllers.fmi.importer uses it. A variadic C function takes its values from the same places as one with many parameters (System V,
x86-64). So the logger is declared with a fixed number of parameters, and the format states which of them were passed.
"""

from __future__ import annotations

import ctypes as ct
import os
import re

WORDS, DOUBLES = 16, 8  # largest number of values that are read: integers and pointers, floating-point numbers
LONGEST = 1000  # bytes of a text
SIGNATURE = ct.CFUNCTYPE(
    None,
    ct.c_void_p,
    ct.c_void_p,
    ct.c_int,
    ct.c_void_p,
    ct.c_void_p,
    ct.c_size_t,
    *[ct.c_double] * DOUBLES,
    *[ct.c_size_t] * (WORDS - 1),
)
_CONVERSION = re.compile(r"%([-+ #0]*)(\d*|\*)(?:\.(\d*|\*))?(hh|h|ll|l|j|z|t|L)?([%diouxXcspfFeEgGaAn])")
_LONG = ("l", "ll", "j", "z", "t")


def text_at(address: int | None) -> str:
    """Return the first bytes of the C string at an address as text; "(null)" or "(unreadable)" where there is none."""
    if not address:
        return "(null)"
    data = b""
    try:
        memory = os.open("/proc/self/mem", os.O_RDONLY)
        try:
            # in two pieces, because the mapped memory may end with the string
            for size in (-address % 4096 or 4096, LONGEST):
                data += os.pread(memory, min(size, LONGEST), address + len(data))
                if b"\0" in data:
                    break
        finally:
            os.close(memory)
    except (OSError, OverflowError):
        if not data:
            return "(unreadable)"
    return data.split(b"\0", 1)[0][:LONGEST].decode("utf-8", "replace")


def formatted(form: str, values: tuple) -> str:
    """Return the text of a printf format and its values.

    Parameters
    ----------
    form : str
        The format; what is no conversion in it stays.
    values : tuple
        The values behind the format, as SIGNATURE passes them.

    Returns
    -------
    str
        The text; the format itself when it names more values than are read.
    """
    words, doubles = iter((values[0], *values[1 + DOUBLES :])), iter(values[1 : 1 + DOUBLES])

    def signed(length: str | None) -> int:
        word = next(words)
        return (ct.c_long if length in _LONG else ct.c_int)(word).value

    def one(match: re.Match) -> str:
        flags, width, precision, length, kind = match.groups()
        if kind == "%":
            return "%"
        if length == "L":
            return match[0]
        width = str(signed(None)) if width == "*" else width
        precision = signed(None) if precision == "*" else None if precision is None else int(precision or 0)
        head = f"%{flags}{width[:3]}" + ("" if precision is None else f".{min(abs(precision), LONGEST)}")
        if kind in "di":
            return f"{head}d" % signed(length)
        if kind in "ouxX":
            return f"{head}{'d' if kind == 'u' else kind}" % (signed(length) % (1 << (64 if length in _LONG else 32)))
        if kind == "c":
            return chr(next(words) & 0x7F)
        if kind == "s":
            return f"{head}s" % text_at(next(words))
        if kind == "p":
            return hex(next(words))
        if kind == "n":  # %n would write to memory; nothing is written here
            next(words)
            return ""
        return f"{head}{'g' if kind in 'aA' else kind}" % next(doubles)

    try:
        return _CONVERSION.sub(one, form)
    except StopIteration:
        return form  # more values than are read
