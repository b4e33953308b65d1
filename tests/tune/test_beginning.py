# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""tuning.yaml: the settings at which the search for a shift begins belong to the rig's folder."""

import shutil

import pytest

from rig_nodes.base.config import RIGS_DIR
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.studies.tune.beginning import read_beginnings

BASED = 'base: hydmag\ndescription: "another one"\n'


@pytest.fixture
def folder(tmp_path):
    """Returns a function that makes a rig's folder, based on hydmag, with the text of its tuning.yaml."""

    def made(text=None):
        path = tmp_path / "own"
        path.mkdir(exist_ok=True)
        (path / "rig.yaml").write_text(BASED, encoding="utf-8")
        if text is not None:
            (path / "tuning.yaml").write_text(text, encoding="utf-8")
        return path

    return made


def of(rig):
    return read_beginnings(rig, load_rig(rig).transmission)


def test_a_rig_has_those_of_its_folder_and_else_of_its_base(folder):
    assert set(of("hydmag")) == {"I-II", "II-I"} and of("hydmag")["I-II"]["delay"] == -260
    assert of(folder()) == of("hydmag")
    text = (RIGS_DIR / "hydmag" / "tuning.yaml").read_text(encoding="utf-8")
    own = of(folder(text.partition("  II-I:")[0].replace("-260 ms", "-0.2 s")))
    assert own == {"I-II": {**of("hydmag")["I-II"], "delay": -200}}


def test_a_base_may_have_other_gears(folder):
    path = folder()
    shutil.copytree(RIGS_DIR / "hydmag", path, dirs_exist_ok=True)
    three = load_rig("three_speed").transmission
    with pytest.raises(RigError, match=r"own/tuning.yaml:\d+: there is no way 'I-II'"):
        read_beginnings(path, three)
    assert read_beginnings("hydmag_coupling", three) == {}, "the base's way I-II is not one of these gears"


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("  II-I:", "  III-I:", r"tuning.yaml:17: there is no way 'III-I'; did you mean 'II-I'"),
        ("P2.gap: 30 ms", "P2.gab: 30 ms", r"tuning.yaml:8: unknown key 'P2.gab'"),
        ("    P2.gap: 30 ms\n", "", r"tuning.yaml:.*P2.gap"),
        ("P1.current: 410 mA", "P1.current: 410 ms", r"tuning.yaml:7: I-II P1.current: .*current"),
        ("P1.current: 410 mA", "P1.current: 900 mA", r"tuning.yaml:7: I-II P1.current is '900 mA', expected .* from 0 to 800 mA"),
        ("P1.time: 30 ms", "P1.time: 30.5 ms", r"tuning.yaml:6: I-II P1.time is '30.5 ms', expected a whole number of ms from 20"),
        ("begin:", "began:", r"tuning.yaml:4: unknown key 'began'"),
    ],
)
def test_a_wrong_one_is_refused_with_its_line(folder, old, new, sentence, capsys):
    text = (RIGS_DIR / "hydmag" / "tuning.yaml").read_text(encoding="utf-8")
    path = folder(text.replace(old, new, 1))
    with pytest.raises(RigError, match=sentence):
        of(path)
    for verb in (["check", str(path)], ["tune", "--rig", str(path), "--out", str(path / "tuned")]):
        assert main(verb) == 2
        assert "tuning.yaml" in capsys.readouterr().err and not (path / "tuned").exists()
