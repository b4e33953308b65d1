# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The settings of a recorded run as text.

The view's page of a run lists them.
"""

from __future__ import annotations

from collections.abc import Mapping

from ..rig import POINT, settings_of, structure_of


def settings_of_run(record: Mapping) -> list[tuple[str, str]]:
    """Return name and value, with its unit, of each setting in the record of a run's rig (bags.rig_in_bag.rig_record)."""
    found = []
    for one in settings_of(structure_of(record["structure"]), record).kept():
        section = record.get(one.owner)
        if isinstance(section, Mapping) and one.key in section and one.dimension != POINT and one.numbers == 1:
            found.append((one.name, one.written(section[one.key])))
    return found
