# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fixtures and helpers of the view's tests: recorded runs, copies of them with parts missing, a reader of Rerun files."""

import functools
import os
import shutil
import sys
from pathlib import Path

import pytest

from rig_nodes.analysis.run_report import build_report, write_report
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.writer import BagWriter
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.outputs import Outputs
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate
from rig_nodes.view.convert import make_view

REQUIRED = os.environ.get("RIG_REQUIRE_VIEW") == "1"  # with this variable set, no test here may be skipped
HERE = Path(__file__).parent
SAMPLE = HERE.parents[1] / "bags" / "sample"
sys.path.insert(0, str(HERE))  # pixels.py

if not REQUIRED:
    pytest.importorskip("rerun", reason="the view needs rerun-sdk")


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    """Turns a skip into a failure where the view must be checked."""
    outcome = yield
    report = outcome.get_result()
    if REQUIRED and report.skipped and HERE in item.path.parents:
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        report.outcome, report.longrepr = "failed", f"RIG_REQUIRE_VIEW=1, and this was to be left out: {reason}"


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """The folder of a demo run, which tests must not change."""
    folder = tmp_path_factory.mktemp("recorded") / "demo"
    run = simulate(load_rig("hydmag"), load_sequence("demo", rig="hydmag"), folder)
    write_report(folder, build_report(Bag(folder), run))
    return folder


@pytest.fixture(scope="session")
def viewed(recorded, tmp_path_factory):
    """The folder of the demo run with its view, which tests must not change."""
    folder = shutil.copytree(recorded, tmp_path_factory.mktemp("viewed") / "demo")
    make_view(folder)
    return folder


@pytest.fixture
def demo(recorded, tmp_path):
    """A demo run of the test's own."""
    return shutil.copytree(recorded, tmp_path / "demo")


@pytest.fixture
def run(tmp_path):
    """A run of 2.6 s with one shift, of the test's own."""
    return shutil.copytree(SAMPLE, tmp_path / "sample")


@pytest.fixture(scope="session")
def tripped(tmp_path_factory):
    """The folder of a run of 0.1 s that a person stopped, without a report and without a shift."""
    folder = tmp_path_factory.mktemp("tripped") / "stopped"
    config = load_rig("hydmag")
    rig = Rig(config, 1, controller="embedded")
    outputs = Outputs(rig, {"sequence": "stopped", "seed": 1})
    with BagWriter(folder, "stopped") as bag:
        for sample in range(100):
            if sample == 50:
                rig.e_stop()
            for topic, stamp, data in outputs.due():
                bag.write(topic, config.catalogue.topics[topic].ros_type, data, stamp)
            rig.advance_samples(1)
    return folder


@pytest.fixture
def without(tmp_path):
    """Makes a copy of the sample run that lacks topics."""

    def copy(*topics):
        bag = Bag(SAMPLE)
        with BagWriter(tmp_path / "less", "less") as less:
            rows = [(stamp, topic, data) for topic in bag.counts if topic not in topics for stamp, data in bag.raw(topic)]
            for stamp, topic, data in sorted(rows, key=lambda row: row[0]):
                less.write(topic, bag.types[topic], data, stamp)
        return tmp_path / "less"

    return copy


class RrdFile:
    """The content of a Rerun file: entity -> column -> values, times in ns, its recording and its layout."""

    def __init__(self, path):
        from rerun.chunk import RrdReader

        self._reader = RrdReader(path)
        self._stores = recording, layout = self._reader.recordings()[0], self._reader.blueprints()[0]
        self.key = recording.recording_id
        self.applications = {recording.application_id, layout.application_id}

    @functools.cached_property
    def data(self):
        return self._entities(self._stores[0])

    @functools.cached_property
    def layout(self):
        return self._entities(self._stores[1])

    def _entities(self, store):
        import pyarrow

        found = {}
        for chunk in self._reader.stream(store=store).to_chunks():
            batch = chunk.to_record_batch()
            for name, column in zip(batch.schema.names, batch.columns):
                if pyarrow.types.is_temporal(column.type):
                    column = column.cast(pyarrow.int64())
                elif pyarrow.types.is_list(column.type):
                    column = column.flatten()
                plain = pyarrow.types.is_primitive(column.type)
                values = column.to_numpy(zero_copy_only=False) if plain else column.to_pylist()
                found.setdefault(chunk.entity_path, {}).setdefault(name, []).extend(values)
        return found

    def rows(self, entity, component):
        """Returns times [ns] and values of a component that has one value in every row."""
        return self.data[entity]["t"], self.data[entity][component]

    def views(self):
        """Returns display name -> entities of all views of the layout with that name."""
        found = {}
        for path, parts in self.layout.items():
            if "ViewBlueprint:display_name" in parts:
                contents = self.layout[f"{path}/ViewContents"]["ViewContents:query"]
                found.setdefault(parts["ViewBlueprint:display_name"][0], []).extend(contents)
        return found


@pytest.fixture(scope="session")
def read_rrd():
    return RrdFile
