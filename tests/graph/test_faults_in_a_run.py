# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults on the graph: the same bits as `simulate`, orders over ROS, and refusals of both."""

import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from running_graph import Client, Graph, rig_run

from rig_nodes.bags.reader import Bag
from rig_nodes.controllers.load import load_controller
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

SEQUENCE = """
description: an upshift with faults
rig: hydmag
steps:
  - oil: {pressure: 4 MPa}
  - wait: {until: {signal: p_p, above: 3.9 MPa}, timeout: 3 s}
  - shift: {to: I, timeout: 3 s}
  - fault: {name: p2.offset, size: 3 %, onset: growing, over: 300 ms}
  - fault: {name: valve_zr_p2.sticking, when: s1_clamp above 100 N}
  - motor: {speed: 300 rpm}
  - wait: {for: 200 ms}
  - fault: {name: p2.offset, off: true}
  - wait: {for: 100 ms}
"""
TIMED = "clutch_s1.worn, size=0.3 mm, at=434 ms, for=300 ms"


def test_a_run_in_lockstep_with_faults_has_the_bits_of_simulate(tmp_path):
    (tmp_path / "ill.yaml").write_text(SEQUENCE)
    code, output = rig_run(tmp_path / "run", "--speed", "max", "--fault", TIMED, sequence=tmp_path / "ill.yaml")
    assert code == 0, output
    config = load_rig("hydmag", {"faults": TIMED})
    simulate(config, load_sequence(tmp_path / "ill.yaml", rig="hydmag", config=config), tmp_path / "simulated")
    ours, theirs = (Bag(tmp_path / name).canonical_hash() for name in ("simulated", "run"))
    # the time at which orders of gears reach the box, and what nodes record beside the rig, differ
    assert {topic for topic in ours if theirs.get(topic) != ours[topic]} <= {"/controller/events", "all"}
    assert "fault injected: valve_zr_p2.sticking" in output and "from 0.434 s to 0.734 s" in output


@pytest.mark.parametrize("spec", ["alfa46", "python:rig_nodes.controllers.examples.alfa46:Alfa46"])
def test_what_a_controller_is_told_fails_alike_in_lockstep_and_in_simulate(tmp_path, spec):
    faults = "measurements.late, size=4 ms; measurements.lost, size=20 %; measurements.corrupted, size=1 %, at=0.5 s"
    (tmp_path / "ill.yaml").write_text(SEQUENCE)
    given = [word for fault in faults.split("; ") for word in ("--fault", fault)]
    code, output = rig_run(tmp_path / "run", "--speed", "max", "--controller", spec, *given, sequence=tmp_path / "ill.yaml")
    assert code == 0, output
    config = load_rig("hydmag", {"faults": faults})
    sequence = load_sequence(tmp_path / "ill.yaml", rig="hydmag", config=config)
    simulate(config, sequence, tmp_path / "simulated", controller=load_controller(spec, config))
    ours, theirs = (Bag(tmp_path / name).canonical_hash() for name in ("simulated", "run"))
    assert {topic for topic in ours if theirs.get(topic) != ours[topic]} <= {"/controller/events", "all"}


def test_what_a_controller_is_told_does_not_fail_in_real_time(tmp_path):
    code, output = rig_run(tmp_path / "run", "--fault", "measurements.late")
    assert code == 2 and "rig: fault measurements.late refused: here all read the rig's measurements from the same topics" in output
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("enabled", [True, False], ids=["enabled", "disabled"])
def test_the_service_of_parameters_takes_orders_where_faults_are_enabled(tmp_path, enabled):
    graph = Graph(tmp_path / "run", settings=["faults=on"] if enabled else [], speed=1.0)
    client = Client(graph.domain)
    try:
        answers = [
            client.call(SetParameters, "/rig/set_parameters", parameters=[Parameter("fault", value=order).to_parameter_msg()])
            for order in ("p1.stuk", "p1.stuck")
        ]
    finally:
        client.close()
        graph.close()
    wrong, right = (answer.results[0] for answer in answers)
    assert not wrong.successful and right.successful == enabled
    if enabled:
        assert "did you mean 'p1.stuck'" in wrong.reason
        assert [text for _, _, name, text, _ in Bag(tmp_path / "run").events() if name == "fault_on"] == [
            "p1.stuck: the signal is frozen, abrupt"
        ]
