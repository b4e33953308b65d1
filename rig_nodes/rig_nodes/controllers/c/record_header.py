# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""rig_record.h: the outputs, transducers and gears of one rig's record by name, for controllers in C and C++.

``rig controller new`` and ``rig export record`` write it; rig_controller.h lies in the same folder.
"""

from __future__ import annotations

import re

from ..record import ControllerRecord

NAME = "rig_record.h"


def header_text(record: ControllerRecord) -> str:
    """Return the text of a record's header."""
    outputs = [f"{_word(output.name)} = {k}" for k, output in enumerate(record.outputs)]
    bits = [f"0x{sum(1 << output for output in gear.outputs):02x}" for gear in record.gears]
    gears = [f"GEAR_{_word(gear.name)} = {gear.number}" for gear in record.gears]
    measured = [
        f"  double {signal.name}; /* {signal.text.rstrip('.')} [{signal.unit}]; {signal.sign} */" for signal in record.transducers
    ]
    return (
        "\n".join(
            [
                "/*",
                " * Copyright 2026 Virtual rig maintainers",
                " * SPDX-License-Identifier: Apache-2.0",
                " */",
                "",
                "/* The outputs, transducers and gears of the rig " + record.rig + " by name, for rig_controller.h.",
                " *",
                f" * ./rig export record --rig {record.rig} writes this file; write it again rather than change it. A controller",
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
                f"enum {{ {', '.join(f'RIG_{entry}' for entry in outputs)} }}; /* places in current, command and setpoint */",
                f"enum {{ {', '.join(f'RIG_{entry}' for entry in gears)} }};",
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
