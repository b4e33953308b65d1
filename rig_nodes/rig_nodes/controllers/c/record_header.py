# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""rig_record.h: the outputs, transducers and gears of one rig's record by name, for controllers in C and C++.

``rig controller new`` and ``rig export record`` write it; rig_controller.h lies in the same folder.
"""

from __future__ import annotations

import re

from ...base import quoted
from ..record import ControllerRecord

NAME = "rig_record.h"
# words of C99, C11 and C++20 that no member can have as its name, and the macros that every compiler or rig_controller.h defines
RESERVED = """
alignas alignof and and_eq asm auto bitand bitor bool break case catch char char8_t char16_t char32_t class co_await co_return
co_yield compl concept const const_cast consteval constexpr constinit continue decltype default delete do double dynamic_cast
else enum explicit export extern false float for friend goto if inline int long mutable namespace new noexcept not not_eq
nullptr operator or or_eq private protected public register reinterpret_cast requires restrict return short signed sizeof static
static_assert static_cast struct switch template this thread_local throw true try typedef typeid typename typeof union unsigned
using virtual void volatile wchar_t while xor xor_eq linux unix NULL
"""


def header_text(record: ControllerRecord) -> str:
    """Return the text of a record's header."""
    constants = {"RIG_OUTPUTS", "RIG_TRANSDUCERS"}
    outputs = [f"{_free(f'RIG_{_word(one.name)}', k, constants)} = {k}" for k, one in enumerate(record.outputs)]
    bits = [f"0x{sum(1 << output for output in gear.outputs):02x}" for gear in record.gears]
    gears = [f"{_free(f'RIG_GEAR_{_word(gear.name)}', gear.number, constants)} = {gear.number}" for gear in record.gears]
    members, measured = set(RESERVED.split()), []
    for signal in record.transducers:
        text = _comment(f"{signal.text.rstrip('.')} [{signal.unit}]; {signal.sign}")
        measured.append(f"  double {_free(signal.name, '', members)}; /* {text} */")
    rig = _comment(record.rig)
    return (
        "\n".join(
            [
                "/*",
                " * Copyright 2026 Virtual rig maintainers",
                " * SPDX-License-Identifier: Apache-2.0",
                " */",
                "",
                f"/* The outputs, transducers and gears of the rig {rig} by name, for rig_controller.h.",
                " *",
                f" * ./rig export record --rig {quoted(rig)} writes this file; write it again rather than change it. A controller",
                " * that is compiled with it runs only on a rig that has the same names and units in the same order.",
                " */",
                "#ifndef RIG_RECORD_H",
                "#define RIG_RECORD_H",
                "",
                '#include "rig_controller.h"',
                "",
                "#undef RIG_CONTROLLER_RECORD",
                f'#define RIG_CONTROLLER_RECORD "{record.id}"',
                "",
                f"enum {{ RIG_OUTPUTS = {len(record.outputs)}, RIG_TRANSDUCERS = {len(record.transducers)} }};",
                f"enum {{ {', '.join(outputs)} }}; /* places in current, command and setpoint */",
                f"enum {{ {', '.join(gears)} }};",
                "",
                "/* Outputs that a gear needs, bit k for output k: those of the valves of its clutches. */",
                "static inline uint32_t rig_outputs_of(uint32_t gear) {",
                f"  static const uint8_t outputs[] = {{{', '.join(bits)}}};",
                "  return gear < sizeof outputs ? outputs[gear] : 0;",
                "}",
                "",
                "typedef struct rig_measured {",
                *measured,
                "} rig_measured;",
                "",
                "static inline const rig_measured *rig_measured_of(const rig_controller_inputs *in) {",
                "  return (const rig_measured *)in->measured;",
                "}",
                "",
                "#endif",
            ]
        )
        + "\n"
    )


def _word(name: str) -> str:
    """Return a name as a part of a constant's name in C."""
    return re.sub(r"\W", "_", name, flags=re.ASCII).upper()


def _free(name: str, end: int | str, taken: set[str]) -> str:
    """Return a name in C, with such an end where it would be taken already, and take it."""
    while name in taken:
        name = f"{name}_{end}"
    taken.add(name)
    return name


def _comment(text: str) -> str:
    """Return a text as a part of a comment in C, which it neither ends nor begins anew."""
    return text.replace("*/", "* /").replace("/*", "/ *")
