# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""An installed package adds a rig, a part, a verb and a format by entry points; a broken one is refused in a sentence."""

import sys

import pytest

from rig_nodes.bags.exchange.foreign import read_foreign
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.plant.parts.part import part
from rig_nodes.rig.configuration import load_rig

RIG = "description: three speeds of another package\nbase: three_speed\n"
PART = """\
from dataclasses import replace

from rig_nodes.plant.parts.freewheel import PART as OURS

PART = replace(OURS, name="sprag")
"""
VERB = """\
HELP = "print a word"


def add_arguments(parser):
    parser.add_argument("word")


def main(args):
    print(f"the word is {args.word}")
    return 4
"""
FORMAT = """\
from rig_nodes.bags.exchange.foreign import Channel, Foreign
from rig_nodes.bags.exchange.formats.format import Format


def read(path, form):
    numbers = [float(line) for line in path.read_text().splitlines()[1:]]
    return Foreign(path, [Channel("p", "p", "bar", numbers)])


FORMAT = Format("a file of BOX", lambda path, head: head.startswith(b"BOX"), read)
"""


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Returns a function that installs a package of modules and other files, and the lines of its entry points."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def installed(points, **files):
        info = tmp_path / "boxes-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: boxes\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(points)
        for name, text in files.items():
            path = tmp_path / "boxes" / name.replace("__", "/").replace("_yaml", ".yaml")
            path = path if path.suffix else path.with_suffix(".py")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)

    yield installed
    for name in [name for name in sys.modules if name.split(".")[0] == "boxes"]:
        del sys.modules[name]


def test_a_rig(install, capsys):
    install("[rig_nodes.rigs]\nfour = boxes.rigs.four\n", rigs__four__rig_yaml=RIG, rigs__four__sequences__up_yaml="steps: []\n")
    config = load_rig("four")
    assert config.name == "four" and config.structure.plain() == load_rig("three_speed").structure.plain()
    assert main(["list", "rigs"]) == 0 and "three speeds of another package" in capsys.readouterr().out
    assert main(["check", "four"]) == 2 and "four/sequences/up.yaml" in capsys.readouterr().err
    with pytest.raises(RigError, match="there is no rig 'fuor'; did you mean 'four'"):
        load_rig("fuor")


def test_a_part(install, tmp_path):
    install("[rig_nodes.parts]\nsprag = boxes.sprag:PART\n", sprag=PART)
    devices = "parts:\n  stop: {part: sprag, called: F1, joins: [ground, ring]}\n"
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "rig.yaml").write_text(RIG + devices)
    config = load_rig(tmp_path / "mine")
    assert config.structure.device("stop").role == "freewheel" and "f1_slip" in config.catalogue.signals
    (tmp_path / "mine" / "rig.yaml").write_text(RIG + devices.replace("sprag", "sprg"))
    with pytest.raises(RigError, match="no part 'sprg'; did you mean 'sprag'"):
        load_rig(tmp_path / "mine")
    key = part("sprag").source
    assert part("sprag").values_dtype({}).names[-1] == f"source_{key}", "its engine is another one when its file changes"


def test_a_verb(install, capsys):
    install("[rig_nodes.verbs]\nsay = boxes.say\n", say=VERB)
    assert main(["say", "yes"]) == 4 and capsys.readouterr().out == "the word is yes\n"
    assert main(["--help"]) == 0 and "say         of the package boxes" in capsys.readouterr().out
    assert main(["say"]) == 2 and "word" in capsys.readouterr().err
    assert main(["sey"]) == 2 and "or 'say'?" in capsys.readouterr().err


def test_a_format(install, tmp_path):
    install("[rig_nodes.formats]\nbox = boxes.box:FORMAT\n", box=FORMAT)
    (tmp_path / "x.csv").write_text("BOX 1\n1.5\n2\n")
    (channel,) = read_foreign(tmp_path / "x.csv").channels
    assert (channel.name, channel.unit, channel.values) == ("p", "bar", [1.5, 2.0])
    (tmp_path / "x.csv").write_text("BOX 1\none\n")
    with pytest.raises(RigError, match=r"x.csv: cannot be read as a file of BOX \(ValueError: could not convert"):
        read_foreign(tmp_path / "x.csv")


@pytest.mark.parametrize(
    ("points", "act", "sentence"),
    [
        (
            "rigs]\nfour = boxes.none",
            lambda _: load_rig("four"),
            "rig 'four' of the package boxes 1.0: boxes.none is no folder 'four'",
        ),
        ("rigs]\nfour = nothing.four", lambda _: load_rig("four"), "boxes 1.0: nothing.four cannot be found (ModuleNotFoundError"),
        ("parts]\nx = boxes.bad:PART", lambda _: part("x"), "part 'x' of the package boxes 1.0: boxes.bad:PART cannot be loaded"),
        ("parts]\nx = boxes.say:HELP", lambda _: part("x"), "boxes.say:HELP is of type str, expected Part"),
        ("parts]\nx = boxes.sprag:PART", lambda _: part("x"), "is a part of the name 'sprag', expected that of the entry point"),
        ("verbs]\nx = boxes.bad", lambda _: main(["x"]), "verb 'x' of the package boxes 1.0: boxes.bad cannot be loaded (ZeroDiv"),
        ("verbs]\nx = boxes.sprag", lambda _: main(["x"]), "boxes.sprag has no HELP, add_arguments, main; mend or uninstall"),
        ("formats]\nx = boxes.say:HELP", read_foreign, "format 'x' of the package boxes 1.0: boxes.say:HELP is of type str"),
    ],
)
def test_a_broken_one_is_refused_in_a_sentence_that_names_the_package(install, tmp_path, capsys, points, act, sentence):
    install(f"[rig_nodes.{points}\n", bad="1 / 0\n", say=VERB, sprag=PART)
    (tmp_path / "x.csv").write_text("t,p\n1,2\n2,3\n")
    try:
        assert act(tmp_path / "x.csv") == 2
        said = capsys.readouterr().err
    except RigError as refusal:
        said = str(refusal)
    assert sentence in said and said.strip().count("\n") == 0
