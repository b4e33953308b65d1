# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The files of a user's own rig are inside its FMU."""

import json
import shutil

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.runs.fmu.build import files_of
from rig_nodes.runs.fmu.rig_process import RigModel


def rig_in(folder, text):
    folder.mkdir(parents=True)
    (folder / "rig.yaml").write_text(f"description: mine\n{text}")
    return str(folder)


def test_a_rig_on_a_base_of_ones_own_is_read_from_the_fmu_alone(tmp_path):
    rig_in(tmp_path / "base", 'base: three_speed\ncontroller_values:\n  t23: [50 ms, "tried"]\n')
    mine = rig_in(tmp_path / "mine", 'base: ../base\ncontroller_values:\n  t32: [70 ms, "tried"]\n')
    file, files = files_of(mine)
    shutil.rmtree(tmp_path / "base")
    shutil.rmtree(tmp_path / "mine")
    resources = tmp_path / "resources"
    for name, text in {**files, "rig.json": json.dumps({"rig": mine, "file": file, "set": {}})}.items():
        (resources / name).parent.mkdir(parents=True, exist_ok=True)
        (resources / name).write_text(text)
    config = RigModel(resources).config
    assert (config.name, config.alfa46.values.t23, config.alfa46.values.t32) == ("mine", 0.05, 0.07)


def test_an_installed_rig_has_no_files_to_take_along():
    assert files_of("three_speed") == ("", {}) == files_of("chapter9")


def test_a_base_by_its_place_on_this_machine_is_refused(tmp_path):
    base = rig_in(tmp_path / "base", "base: hydmag\n")
    mine = rig_in(tmp_path / "mine", f"base: {base}\n")
    with pytest.raises(RigError, match="base is .*, which an FMU cannot take along"):
        files_of(mine)
