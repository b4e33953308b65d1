# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parts of one type have one set of values; they differ only in their connections."""

import dataclasses

from rig_nodes.rig.configuration import load_rig

# values of the pack and its oil passages, which have the same design in both clutches
OF_THE_PACK = (
    "pack_rate",
    "pack_travel",
    "feed_area",
    "line_volume",
    "chamber_volume",
    "piston_damping",
    "seal_friction",
    "seal_friction_share",
)


def test_both_valves_are_one_valve():
    """Both are of the type 3WZCDE6 (tab. 3.4); no value is that of a single specimen."""
    config = load_rig("hydmag")
    assert dataclasses.asdict(config.valve_zr_p1) == dataclasses.asdict(config.valve_zr_p2)


def test_both_packs_are_pressed_together_alike():
    s1, s2 = (dataclasses.asdict(values) for values in (load_rig("hydmag").clutch_s1, load_rig("hydmag").clutch_s2))
    assert {name: s1[name] for name in OF_THE_PACK} == {name: s2[name] for name in OF_THE_PACK}
