# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What an FMU of FMI 2.0 says to its logger: a printf format and its values, made into text without trusting them.

Used by fmu.importer. A variadic C function takes its values where one with many parameters would (System V, x86-64): so
the logger is declared with room for some, and the format tells which of them were given.
"""

from __future__ import annotations

import ctypes as ct
import os
import re

WORDS, DOUBLES = 16, 8  # values that can be looked at: integers and pointers, floating-point numbers
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
    """The C string at an address, its first bytes; what is told of it where nothing can be read."""
    if not address:
        return "(null)"
    data = b""
    try:
        memory = os.open("/proc/self/mem", os.O_RDONLY)
        try:
            # in two pieces: the end of the string may be the end of what is mapped
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
    """The text of a printf format and of the values behind it as SIGNATURE brings them; what is no conversion stays."""
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
        if kind == "n":  # it writes; nothing is written here
            next(words)
            return ""
        return f"{head}{'g' if kind in 'aA' else kind}" % next(doubles)

    try:
        return _CONVERSION.sub(one, form)
    except StopIteration:
        return form  # more values than are looked at
