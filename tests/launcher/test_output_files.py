# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""No option of any verb overwrites a recording, a rig, a run's own files or a file of the user's; made from the verbs' parsers."""

import argparse
import importlib
import os
import shutil
from pathlib import Path

import pytest

from rig_nodes.base.arguments import Parser
from rig_nodes.base.config import TEMPLATE_DIR
from rig_nodes.base.errors import RigError
from rig_nodes.base.products import KINDS, MARK, NEVER
from rig_nodes.cli.main import VERBS, main, run_verb
from rig_nodes.cli.output_files import OutputFile, OutputFolder
from rig_nodes.runs.fmu.build import build_rig_fmu

SAMPLE = Path(__file__).parents[2] / "bags" / "sample"
LOGGED = """Messung;x
Prüfstand;HydmAG
Zeit;Drehmoment Antrieb;Drehzahl Antrieb;Drehmoment Abtrieb;Drehzahl Abtrieb;Druck Kupplung 1;Druck Kupplung 2
s;Nm;1/min;Nm;1/min;bar;bar
0,0000;65,12;1500,3;79,87;1085,1;23,04;-0,02
0,0001;65,12;1500,3;79,87;1085,1;23,04;-0,02
0,0002;65,12;1500,3;79,87;1085,1;23,04;-0,02
"""
# options whose metavar looks like a file or a folder that are for reading
READ = {("tune", "--spreads"), ("modes", "--detune"), ("replay", "--qos"), ("report", "--limits"), ("export", "--include")}
READ |= {("faults bench", "--detector")}
READ |= {("export", "sources"), ("import", "file")}
# how each verb is called that makes a folder
FOLDERS = {
    "run": ["demo"],
    "simulate": ["demo"],
    "procedure": ["coast_down"],
    "sweep": ["demo", "--vary", "seed=1"],
    "tune": [],
    "new rig": [],
    "controller new": ["python"],
    "rerun": [str(SAMPLE), "--through", "plant"],
    "bag recover": [str(SAMPLE)],
    "bag cut": [str(SAMPLE)],
    "bag merge": [str(SAMPLE)],
    "import": ["{csv}", "--profile", "german"],
}


def options_of(parser, words):
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, below in action.choices.items():
                yield from options_of(below, [*words, name])
        else:
            yield words, parser, action


def every_option():
    for verb in VERBS.own:
        parser = Parser(prog=f"rig {verb}", allow_abbrev=False)
        importlib.import_module(f"rig_nodes.cli.{verb}").add_arguments(parser)
        yield from options_of(parser, [verb])


def name_of(action):
    return action.option_strings[-1] if action.option_strings else action.dest


OPTIONS = list(every_option())
OUTPUTS = {f"{' '.join(words)} {name_of(action)}": (words, parser, action) for words, parser, action in OPTIONS
           if isinstance(action.type, OutputFile)}  # fmt: skip


def test_every_option_that_names_a_file_or_folder_says_whether_it_is_written():
    looks = [
        (" ".join(words), name_of(action), action.type)
        for words, _, action in OPTIONS
        if isinstance(action.metavar, str) and any(part in action.metavar for part in ("FILE", "DIR", "FOLDER"))
    ]
    unknown = [
        (verb, option)
        for verb, option, kind in looks
        if not isinstance(kind, (OutputFile, OutputFolder)) and (verb, option) not in READ and verb not in FOLDERS
    ]
    assert len(looks) > 30 and unknown == []


def call_of(words, parser, action, target):
    """Returns a command with the option and what the verb cannot do without."""
    needed = []
    for other in parser._actions:
        if other.option_strings and not other.required:
            continue
        many = 1 if other.nargs in (None, "+", "*", "?") else other.nargs
        value = next(iter(other.choices)) if other.choices else str(SAMPLE)
        needed += [*other.option_strings[-1:], *[value] * many] if other is not action else []
    return [words[0], [*words[1:], *needed, f"{name_of(action)}={target}" if name_of(action).startswith("--") else target]]


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """Returns files that must stay, by what they are."""
    folder = tmp_path_factory.mktemp("places")
    run = folder / "run"
    shutil.copytree(SAMPLE, run)
    rig = folder / "rig"
    shutil.copytree(TEMPLATE_DIR, rig)
    made = {"recording": run / "sample_0.mcap", "report": run / "report.json", "metadata": run / "metadata.yaml"}
    made |= {"rig": rig / "rig.yaml", "sequence": next((rig / "sequences").glob("*.yaml"))}
    for ending in sorted({ending for kind in KINDS.values() for ending in kind.endings} | {".json", ".db3"}):
        one = made[f"user's own {ending}"] = folder / f"mine{ending}"
        one.write_bytes(b"mine, for which I worked a week\n")
        (folder / f"soft{ending}").symlink_to(run / "sample_0.mcap")
        os.link(run / "sample_0.mcap", folder / f"hard{ending}")
        made |= {f"link {ending}": folder / f"soft{ending}", f"hard link {ending}": folder / f"hard{ending}"}
    for name, text in (("table", '{"columns": ["a"], "rows": [[1]]}'), ("machine", '{"machine": "lathe 7"}')):
        made[f"user's {name} in JSON"] = folder / f"{name}.json"
        made[f"user's {name} in JSON"].write_text(text)
    made["through .."] = folder / "rig" / ".." / "run" / "sample_0.mcap"
    made["a controller"] = folder / "mine.py"
    made["a controller"].write_text("class Controller: pass\n")
    return made


@pytest.fixture
def sample(tmp_path):
    """Returns the folder of a copy of the sample bag, whose report `rig report` may write anew."""
    return str(shutil.copytree(SAMPLE, tmp_path / "sample"))


@pytest.mark.parametrize("option", OUTPUTS)
def test_no_file_that_is_there_is_overwritten_by_the_option(places, option, monkeypatch):
    words, parser, action = OUTPUTS[option]
    reached = []
    monkeypatch.setattr(importlib.import_module(f"rig_nodes.cli.{words[0]}"), "main", lambda args: reached.append(args) or 0)
    before = {name: path.read_bytes() for name, path in places.items()}
    for target in [*places.values(), places["recording"].parent, Path("/dev/null"), Path("/nowhere/x.html")]:
        with pytest.raises(RigError) as refused:
            run_verb(*call_of(words, parser, action, target))
        assert str(target) in str(refused.value) and "\n" not in str(refused.value)
    assert reached == [] and {name: path.read_bytes() for name, path in places.items()} == before
    free = (
        places["recording"].parent.parent
        / f"free{action.type.kind_for(argparse.Namespace(layout='foxglove', what='fmu')).endings[0]}"
    )
    if words[0] not in ("view", "export"):  # whose endings depend on more arguments
        run_verb(*call_of(words, parser, action, free))
        assert len(reached) == 1


@pytest.mark.parametrize("verb", FOLDERS)
def test_no_folder_or_file_that_is_there_is_overwritten_by_the_folder_of_a_verb(places, verb, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    csv = tmp_path / "a.csv"
    csv.write_text(LOGGED, encoding="cp1252")
    words, _, action = next(
        (words, parser, action)
        for words, parser, action in OPTIONS
        if " ".join(words) == verb and action.metavar in ("DIR", "FOLDER")
    )
    for target in (places["recording"].parent, places["recording"], places["rig"].parent, places["link .json"]):
        before = sorted((path, path.stat().st_mtime_ns) for path in places["recording"].parent.parent.rglob("*"))
        given = [one.format(csv=csv) for one in FOLDERS[verb]]
        assert main([*words, *given, *action.option_strings[-1:], str(target)]) in (1, 2)
        assert sorted((path, path.stat().st_mtime_ns) for path in places["recording"].parent.parent.rglob("*")) == before
        said = capsys.readouterr().err
        assert str(target) in said and said.startswith("rig: ") and said.count("\n") == 1


def test_a_new_file_may_not_take_a_name_that_the_folder_of_a_run_needs(tmp_path):
    shutil.copy(SAMPLE / "sample_0.mcap", tmp_path)
    for name in ("report.json", "Report.JSON", "sweep.json"):
        with pytest.raises(RigError, match="keeps its own"):
            run_verb("compare", [str(SAMPLE), str(SAMPLE), "--json", str(tmp_path / name)])


def test_a_file_that_the_verb_reads_is_not_overwritten(tmp_path, sample):
    page = tmp_path / "page.html"
    page.write_text('<!DOCTYPE html>\n<meta name="generator" content="rig_nodes">')
    with pytest.raises(RigError, match="it is a file that is read"):
        run_verb("report", [sample, "--html", str(page), "--limits", str(page)])


def test_an_older_product_of_the_same_kind_is_replaced(sample, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for words in (
        ["report", sample, "--html", "page.html", "--picture", "shift.svg"],
        ["compare", str(SAMPLE), str(SAMPLE), "--json", "c.json", "--html", "c.html", "--rrd", "c.rrd"],
    ):
        assert main(words) == 0, capsys.readouterr().err
        with monkeypatch.context() as patch:  # to draw all once more would show no more than that it may begin
            patch.setattr(importlib.import_module(f"rig_nodes.cli.{words[0]}"), "main", lambda _: 0)
            assert main(words) == 0, capsys.readouterr().err
    for words in (
        ["modes", "clutch_bench", "--json", "m.json", "--picture", "m.svg"],
        ["check", "clutch_bench", "--picture", "p.svg"],
        ["calculate", "--rig", "ural2", "--json", "k.json"],
        ["export", "dbc"],
        ["export", "registers"],
        ["export", "record"],
        ["view", "--layout", "foxglove"],
        ["view", "--layout", "plotjuggler"],
    ):
        assert [main(words) for _ in range(2)] == [0, 0], capsys.readouterr().err
    build_rig_fmu(Path("a.fmu"), "hydmag", {}, 2)
    assert KINDS["fmu"].own(b"", Path("a.fmu"))
    assert set(KINDS) - {
        "page",
        "picture",
        "rrd",
        "json",
        "svg",
        "dbc",
        "registers",
        "record",
        "foxglove",
        "plotjuggler",
        "fmu",
    } == {
        "pdf",  # tests/analysis/test_report_page.py and tests/view/test_view_pixels.py write these
        "png",
        "controller-fmu",
    }
    assert not NEVER.own(b"", Path("a.fmu")) and MARK
