# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A run as a CAN log holds the frames that the CAN plug sends, and the controller's answers, at their simulated times."""

from __future__ import annotations

import itertools

import can
import cantools
import pytest
from laboratory import SAMPLE

from rig_nodes.api.exported import exported
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.writer import LIBRARY_OF_RUN, BagWriter
from rig_nodes.cli.main import main
from rig_nodes.controllers import load_controller
from rig_nodes.controllers.can.bus import open_bus
from rig_nodes.rig.recorded_rig import config_of_record

RPM = 0.10471975511965977


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("can")


@pytest.fixture(scope="module")
def bag():
    return Bag(SAMPLE)


def frames(folder, kind="blf"):
    path = folder / f"run.{kind}"
    if not path.exists():
        assert main(["export", kind, str(SAMPLE), "--out", str(path)]) == 0
    return list(can.LogReader(path))


@pytest.fixture(scope="module")
def database(folder):
    assert main(["export", "dbc", "-o", str(folder / "rig.dbc")]) == 0
    return cantools.database.load_file(folder / "rig.dbc")


def test_blf_asc_and_candump_hold_the_same_frames_at_simulated_times(folder, bag):
    logs = [
        [(round(one.timestamp, 6), one.arbitration_id, bytes(one.data)) for one in frames(folder, k)] for k in ("blf", "asc", "log")
    ]
    assert logs[0] == logs[1] == logs[2]
    times = [t for t, *_ in logs[0]]
    assert times == sorted(times) and times[0] == 0.0 and times[-1] == pytest.approx(bag.last * 1e-9, abs=2e-3)
    assert {one.channel for one in frames(folder)} == {0}
    assert "1970" not in (folder / "run.asc").read_text()[:500]


def test_the_database_decodes_every_frame_to_what_the_run_recorded(folder, bag, database):
    found = {}
    for one in frames(folder):
        message = database.get_message_by_frame_id(one.arbitration_id)
        found.setdefault(message.name, []).append((one.timestamp, message.decode(bytes(one.data), decode_choices=False)))
    assert {*found} == {
        "ADDRESS_CLAIMED", "RIG_REQUEST", "RIG_MEASURED", "RIG_CURRENTS", "CONTROL_STATE", "CONTROL_COMMAND_DUTY", "ETC1", "ETC2"
    }  # fmt: skip
    times, (measured, current) = bag.fields("/instruments/controller", ["measured", "current"])
    assert [t for t, _ in found["RIG_MEASURED"]] == pytest.approx(times.tolist())
    assert [one["n_wej"] for _, one in found["RIG_MEASURED"]] == pytest.approx((measured[:, 0] / RPM).tolist(), abs=0.051)
    assert [one["current_1"] for _, one in found["RIG_CURRENTS"]] == pytest.approx((current[:, 0] * 1e3).tolist(), abs=0.026)
    times, (sample, gear, duty) = bag.fields("/controller/command", ["sample", "gear", "duty"])
    assert [t for t, _ in found["CONTROL_STATE"]] == pytest.approx(times.tolist())
    assert [one["sample"] for _, one in found["CONTROL_STATE"]] == (sample % 65536).tolist()
    assert [one["gear"] for _, one in found["CONTROL_STATE"]] == gear.tolist()
    assert [one["command_1"] for _, one in found["CONTROL_COMMAND_DUTY"]] == pytest.approx(
        (duty[:, 0] * 100.0).tolist(), abs=1.1e-3
    )
    ordered = [(t, value) for t, _, name, _, value in bag.events() if name == "shift_ordered"]
    requests = [(t, one["gear_request"]) for t, one in found["RIG_REQUEST"]]
    changes = [after for before, after in itertools.pairwise(requests) if before[1] != after[1]]
    assert changes == [(pytest.approx(t), value) for t, value in ordered]


def test_the_rigs_frames_are_those_that_the_plug_sends(folder, bag):
    bus = open_bus("can-log", "virtual", "test")
    plug = load_controller("can:can-log?interface=virtual", config_of_record(bag.record, str(SAMPLE)), "duty")
    try:
        sent = []
        _, (current, measured) = bag.fields("/instruments/controller", ["current", "measured"])
        orders = {round(t * 1e3): int(value) for t, _, name, _, value in bag.events() if name == "shift_ordered"}
        for sample in range(120):
            if sample in orders:
                plug.order(orders[sample])
            plug.step(sample, current[sample].tolist(), measured[sample].tolist())
        while frame := bus.recv(0.0):
            sent.append((frame.arbitration_id, bytes(frame.data)))
    finally:
        plug.close()
        bus.shutdown()
    of_rig = (0x100, 0x101, 0x102, 0x18F00503)
    logged = [
        (one.arbitration_id, bytes(one.data)) for one in frames(folder) if one.timestamp < 0.1195 and one.arbitration_id in of_rig
    ]
    assert [one for one in sent if one[0] in of_rig] == logged and len(logged) > 240


@pytest.mark.parametrize(
    "options, sentence",
    [
        (["--signals", "p1"], "--signals, --units and --clock are for csv, parquet, mf4, mat; blf holds the frames of rig.dbc"),
        (["--out", "x.asc"], "export blf writes a file that ends in .blf"),
    ],
)
def test_what_a_can_log_does_not_take_is_refused(options, sentence, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["export", "blf", str(SAMPLE), *options]) == 2
    error = capsys.readouterr().err
    assert sentence in error and error.count("\n") == 1 and not list(tmp_path.iterdir())


def test_an_imported_run_has_no_frames(tmp_path, capsys):
    rows = "".join(f"{n / 1000};1;2;3;4;5;6\n" for n in range(30))
    (tmp_path / "a.csv").write_text("t [s];M_wej [Nm];n_wej [rpm];M_wyj [Nm];n_wyj [rpm];p1 [bar];p2 [bar]\n" + rows)
    assert main(["import", str(tmp_path / "a.csv"), "--rig", "hydmag", "--out", str(tmp_path / "run")]) == 0
    assert main(["export", "log", str(tmp_path / "run"), "--out", str(tmp_path / "a.log")]) == 2
    assert "holds no samples and answers of a shift controller" in capsys.readouterr().err and not (tmp_path / "a.log").exists()


def test_a_run_without_a_message_after_its_start_is_one_sentence(bag, tmp_path, capsys):
    with BagWriter(tmp_path / "run", "run", topics=bag.catalogue.all_topics) as writer:
        for time, topic, data in bag.timeline():
            if not time:
                writer.write(topic, bag.types[topic], data, time)
    assert main(["export", "blf", str(tmp_path / "run"), "--out", str(tmp_path / "a.blf")]) == 2
    assert capsys.readouterr().err.endswith("nothing was recorded: the run was stopped before its time began\n")
    assert not (tmp_path / "a.blf").exists()


def test_the_log_of_a_run_that_was_cut_off_says_so(bag, tmp_path):
    rows = bag.timeline()
    with BagWriter(tmp_path / "run", "run", topics=bag.catalogue.all_topics, library=LIBRARY_OF_RUN) as writer:
        for time, topic, data in rows[: len(rows) // 4]:
            writer.write(topic, bag.types[topic], data, time)
    for ending in (".blf", ".csv"):
        found = exported(tmp_path / "run", tmp_path / f"a{ending}")
        assert found.cut_off.startswith("the run was cut off at ") and found.file.exists()
    whole = exported(SAMPLE, tmp_path / "whole.blf")
    assert whole.cut_off == "" and whole.count > found.count
