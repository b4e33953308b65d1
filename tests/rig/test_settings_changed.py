# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which settings of a run are said to differ from its rig's."""

from rig_nodes.rig import changed_settings, load_rig


def test_only_what_differs_is_said_also_of_a_run_of_an_earlier_version():
    record = load_rig("hydmag").as_dict()
    assert changed_settings(record) == ([], "")
    del record["plate_pack"]["break_slip"], record["clutch_s1"]["hose_give"]  # unknown then, and off by default
    assert changed_settings(record) == ([], "")
    record["plate_pack"]["friction_static"] = 0.2
    del record["clutch_s1"]["piston_area"]  # without a default
    assert [row[0] for row in changed_settings(record)[0]] == ["plate_pack.friction_static", "clutch_s1.piston_area"]
