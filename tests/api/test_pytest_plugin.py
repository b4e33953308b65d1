# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plugin of pytest in projects of others: what chooses rig, run and bag, what failures say, and the folder of examples."""

import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import numpy.fft  # what an inner run loads of numpy as the first could not be loaded again by the next one
import pytest

import rig_nodes
from rig_nodes import assert_events, assert_never, assert_shift, assert_stays
from rig_nodes.api.checks import EVENTS
from rig_nodes.api.signals import Signal
from rig_nodes.base import RigError

pytest_plugins = ["pytester"]

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples" / "pytest"
PLUGIN = ("-p", "rig_nodes.api.pytest_plugin", "-p", "no:cacheprovider")
SHORT = """
STEPS = [{"oil": {"pressure": "4 MPa"}}, {"wait": {"for": "300 ms"}}, {"shift": {"to": "I"}}, {"wait": {"for": "100 ms"}}]
"""


class Keeps:
    """Plugin that notes the modules of a run of pytest within this process, which pytester would have loaded once more."""

    modules: ClassVar = {}

    def pytest_unconfigure(self):
        self.modules.update({name: module for name, module in sys.modules.items() if name.partition(".")[0] == "rig_nodes"})


@pytest.fixture(autouse=True)
def _whole():
    """Begins before pytester and ends after it."""
    yield
    sys.modules.update(Keeps.modules)


def within(pytester, *options):
    """Run pytest with the plugin in this process."""
    return pytester.runpytest_inprocess(*PLUGIN, *options, plugins=[Keeps()])


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """A saved run of the demo."""
    run = rig_nodes.load("hydmag").simulate("demo")
    run.save(tmp_path_factory.mktemp("runs") / "demo")
    return run


def test_the_examples_pass(pytester):
    shutil.copytree(EXAMPLES, pytester.path, dirs_exist_ok=True)
    result = within(pytester, "--junitxml=found.xml")
    result.assert_outcomes(passed=5)
    suite = ElementTree.parse(pytester.path / "found.xml").getroot().find("testsuite")
    assert suite.get("tests") == "5" and suite.get("failures") == "0"


def test_pytest_finds_it_by_its_entry_point(tmp_path):
    info = tmp_path / "example-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: example\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[pytest11]\nrig_nodes = rig_nodes.api.pytest_plugin\n")
    (info / "RECORD").write_text("")
    paths = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "--fixtures", "-c", os.devnull, "--rootdir", str(tmp_path), str(tmp_path)],
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "The rig that was chosen, with its settings." in done.stdout
    assert "The recorded run that was chosen." in done.stdout


def test_marker_command_line_and_ini_file_choose_in_this_order_with_settings_for_their_own_rig(pytester):
    pytester.makeini("[pytest]\nrig = hydmag\nrig_set =\n    alfa46.t12=-100 ms\n    alfa46.t21=-110 ms\n")
    pytester.makepyfile(
        """
        import pytest

        def test_options(rig):
            assert (rig.name, rig.settings) == ("three_speed", {"alfa46.t12": "-120 ms"})

        @pytest.mark.rig("hydmag", settings={"alfa46.t21": "-130 ms"})
        def test_marker(rig):
            values = rig.config.alfa46.values
            assert (rig.name, values.t12, values.t21) == ("hydmag", -0.1, -0.13)

        @pytest.mark.rig("chain_saw")
        def test_another(rig):
            assert (rig.name, rig.settings) == ("chain_saw", {})
        """
    )
    within(pytester, "--rig", "three_speed", "--rig-set", "alfa46.t12=-120 ms").assert_outcomes(passed=3)


def test_settings_without_a_rig_are_for_that_of_the_test(pytester):
    pytester.makepyfile(
        """
        import pytest

        @pytest.mark.rig("hydmag")
        def test_it(rig):
            assert rig.settings == {"alfa46.t12": "-120 ms"}
        """
    )
    within(pytester, "--rig-set", "alfa46.t12=-120 ms").assert_outcomes(passed=1)


def test_files_are_named_from_the_file_that_names_them(pytester):
    own = pytester.mkdir("own")
    (own / "mine").mkdir()
    (own / "mine" / "rig.yaml").write_text("description: mine\nbase: hydmag\n")
    (own / "standing.yaml").write_text("description: stands\nsteps:\n  - wait: {for: 20 ms}\n")
    (pytester.path / "turning.yaml").write_text("description: turns\nsteps:\n  - wait: {for: 10 ms}\n")
    (own / "pytest.ini").write_text("[pytest]\nrig = mine\nrig_sequence = ../turning.yaml\n")
    (own / "test_it.py").write_text(
        "import pytest\n\n\ndef sequence(run):\n    return run.report['run']['sequence']\n\n\n"
        "def test_ini(run):\n    assert (run.record['name'], sequence(run)) == ('mine', 'turning')\n\n\n"
        "@pytest.mark.rig('./mine', sequence='standing.yaml', delay=2)\ndef test_marker(run):\n"
        "    assert (sequence(run), run.report['run']['controller']['delay']) == ('standing', 2)\n"
    )
    within(pytester, "own").assert_outcomes(passed=2)


def test_tests_with_the_same_choice_share_a_run(pytester):
    pytester.makepyfile(
        SHORT
        + """
import pytest

pytestmark = pytest.mark.rig("hydmag", sequence=STEPS)

def test_first(run, request):
    request.config.first = run

def test_same(run, request):
    assert run is request.config.first

@pytest.mark.rig(seed=2)
def test_other(run, request):
    assert run is not request.config.first and run.report["run"]["seed"] == 2
"""
    )
    within(pytester).assert_outcomes(passed=3)


def test_a_bag_is_opened_where_it_is_named(pytester, demo, tmp_path):
    shutil.copytree(demo.folder, pytester.path / "recorded")
    pytester.makeini("[pytest]\nrig_bag = recorded\n")
    pytester.makepyfile(
        """
        from rig_nodes import assert_shift

        def test_it(bag):
            assert_shift(bag, "I-II", t_c="< 700 ms")
        """
    )
    within(pytester).assert_outcomes(passed=1)
    within(pytester, "--rig-bag", "nowhere").stdout.fnmatch_lines(["*nowhere*there is no*"])


def test_a_loggers_file_is_of_the_rig_that_is_named(pytester, demo):
    logged = demo.to_pandas(["M_wej", "n_wej", "M_wyj", "n_wyj", "p1", "p2"], period="1 ms")
    logged.columns = [f"{name} [{logged.attrs['units'][name]}]" for name in logged.columns]
    logged.rename_axis("time [s]").to_csv(pytester.path / "log.csv")
    shutil.copytree(demo.folder, pytester.path / "recorded")
    pytester.makeini("[pytest]\nrig = hydmag\n")
    pytester.makepyfile(
        """
        import pytest

        @pytest.mark.rig(bag="log.csv", orders="0.195:0-1, 3.845:1-2, 8.32:2-1")
        def test_logged(bag):
            assert bag.record["name"] == "hydmag" and list(bag.shifts["to_gear"]) == ["II", "I"]

        @pytest.mark.rig(bag="recorded")
        def test_recorded(bag):
            assert len(bag.shifts) == 2
        """
    )
    within(pytester).assert_outcomes(passed=2)


def test_a_failure_is_one_message_without_the_inside_of_the_assertion(pytester, demo):
    shutil.copytree(demo.folder, pytester.path / "recorded")
    pytester.makepyfile(
        """
        import pytest
        from rig_nodes import assert_shift

        @pytest.mark.rig(bag="recorded")
        def test_it(bag):
            assert_shift(bag, "I-II", t_c="< 600 ms")
        """
    )
    result = within(pytester, "--junitxml=found.xml")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["E *AssertionError: shift 1, I -> II at 3.85 s: t_c is 672 +- 1 ms, expected < 600 ms"])
    result.stdout.no_fnmatch_line("*checks.py*")
    assert "t_c is 672 +- 1 ms" in (pytester.path / "found.xml").read_text()


@pytest.mark.parametrize(
    "test,options,sentence",
    [
        ("def test_it(rig): ...", (), "no rig is named; give --rig NAME, rig = NAME in the ini file, or @pytest.mark.rig(NAME)"),
        ("def test_it(bag): ...", (), "no bag is named; give --rig-bag PATH*"),
        ("def test_it(rig): ...", ("--rig", "hydmaq"), "*hydmaq*"),
        ("def test_it(rig): ...", ("--rig", "hydmag", "--rig-set", "alfa46.t12"), "*'alfa46.t12': expected NAME=VALUE*"),
        ("def test_it(run): ...", ("--rig", "hydmag", "--rig-seed", "x"), "*seed is 'x', expected a whole number"),
        ("def test_it(run): ...", ("--rig", "hydmag", "--rig-sequence", "dmeo"), "*dmeo*did you mean 'demo'*"),
        (
            "import pytest\n@pytest.mark.rig(sed=1)\ndef test_it(rig): ...",
            (),
            "the marker rig has no sed; it takes name, sequence*",
        ),
    ],
)
def test_a_wrong_choice_is_one_sentence(pytester, test, options, sentence):
    pytester.makepyfile(test)
    result = within(pytester, *options)
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([sentence])
    result.stdout.no_fnmatch_line("*pytest_plugin.py*")
    result.stdout.no_fnmatch_line("*During handling of*")


def failure(function, *arguments, **named) -> str:
    with pytest.raises(AssertionError) as failed:
        function(*arguments, **named)
    return str(failed.value)


def test_a_shift_is_held_against_limits_of_both_kinds(demo):
    assert_shift(demo, "I-II", t_c="< 700 ms", t_c_s="> 0.5 s", k="0.9 .. 1.01", input_torque_max_nm="<= 300 Nm")
    said = failure(assert_shift, demo, "I-II", t_c="< 600 ms", k="> 1.2")
    assert said.splitlines() == [
        "shift 1, I -> II at 3.85 s: t_c is 672 +- 1 ms, expected < 600 ms",
        "shift 1, I -> II at 3.85 s: k is 0.997 +- 0.002, expected > 1.2",
    ]


def test_a_shift_that_is_missing_or_not_valid_is_said(demo):
    late = rig_nodes.load("hydmag", **{"alfa46.t12": "500 ms"}).simulate("demo")
    assert "shift 1, I -> II at 3.85 s: it is not valid: " in failure(assert_shift, late, "I-II", k="> 0.5")
    with pytest.raises(RigError, match="there is no shift 'I-III'; did you mean 'I-II'"):
        assert_shift(demo, "I-III")
    with pytest.raises(RigError, match="there is no result in this report 'tc'"):
        assert_shift(demo, "I-II", tc="< 1 s")
    with pytest.raises(RigError, match="t_c is '600 ms', expected e.g. '< 600 ms'"):
        assert_shift(demo, "I-II", t_c="600 ms")
    with pytest.raises(RigError, match="t_c is 0.7, expected e.g. '< 600 ms'"):
        assert_shift(demo, "I-II", t_c=0.7)
    with pytest.raises(RigError, match="'600 MPa' is a pressure, expected a time"):
        assert_shift(demo, "I-II", t_c="< 600 MPa")


def test_events_are_looked_for_in_their_order(demo):
    assert_events(demo, "shift to I ordered", "shift_done", "shift to II ordered", "sequence_done")
    said = failure(assert_events, demo, "shift to II ordered", "rig_tripped")
    assert said.startswith("no 'rig_tripped' after 'shift to II ordered' at 3.845 s; after it came 5.320 s ")
    assert "; did you mean 'shift_done' or" in failure(assert_events, demo, "shift_dnoe")
    assert "did you mean" not in failure(assert_events, demo, "sequence_done", "shift_done")


def test_an_event_that_must_not_come_is_said_with_its_time(demo):
    assert_never(demo, "rig_tripped")
    assert failure(assert_never, demo, "sequence_done").startswith("sequence_done at 13.295 s, which must not come: sequence demo")


def test_a_mistyped_name_of_an_event_that_must_not_come_is_refused(demo):
    with pytest.raises(RigError, match="there is no event 'rig_triped'; did you mean 'rig_tripped'"):
        assert_never(demo, "rig_triped")
    assert_never(demo, "my_shift_done", "shift to III")


def test_every_event_that_the_rig_sends_is_a_known_name():
    sources = [path.read_text(encoding="utf-8") for path in Path(rig_nodes.__file__).parent.rglob("*.py")]
    sent = {name for text in sources for name in re.findall(r'\.event\(\s*(?:"/[\w/]+", |[A-Z_]+, |topic, )?"(\w+)"', text)}
    assert len(sent) > 8 and sent - {*EVENTS} == set()


def test_a_signal_whose_values_were_lost_is_not_within_its_bounds(demo):
    known = demo.signals["M_wej"]
    lost = Signal(numpy.full(len(known), numpy.nan), known.time, known.name, known.unit, known.text)
    with pytest.raises(RigError, match="M_wej has no values from 0 to 5 s"):
        assert_stays(SimpleNamespace(signals={"M_wej": lost}), "M_wej", below="1 Nm", start=0.0, end=5.0)


def test_a_signal_beyond_its_bound_is_said_with_its_worst_value_time_and_shift(demo):
    assert_stays(demo, "M_wej", below="200 Nm", end=3.0)
    said = failure(assert_stays, demo, "M_wej", below="200 Nm")
    assert said.startswith("M_wej is 266.6 Nm at 4.516 s (after the order of shift 1, I -> II at 3.85 s), expected below 200 Nm")
    said = failure(assert_stays, demo, "n_wej", above="1600 rpm", start=3.0, end=4.0)
    assert "expected above 1600 rpm; it is beyond from 3.000 s on" in said and said.startswith("n_wej is 1")
    for options, sentence in (
        ({"below": "200 MPa"}, "M_wej below: '200 MPa' is a pressure"),
        ({"below": "1 Nm", "start": 99.0}, "M_wej has no values from 99 to inf s"),
        ({}, "M_wej has no bound"),
    ):
        with pytest.raises(RigError, match=sentence):
            assert_stays(demo, "M_wej", **options)
