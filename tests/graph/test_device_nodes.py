# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One class for the nodes of all devices: topics, setpoints and parameters come from the parts of the rig."""

import pytest
import rclpy

from rig_nodes.controllers.ros.domain import allocate, use_own_transports
from rig_nodes.nodes.commands import Commands
from rig_nodes.nodes.device import DeviceNode, device_names, pace_of, setpoints_taken
from rig_nodes.nodes.rig_container import rig_on_the_graph
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.outputs import Outputs
from rig_nodes.runs.sequence import BY_HAND
from rig_nodes.runs.simulation import run_record

PARAMETERS = {
    "hydmag": {
        "motor": {"speed", "enabled"},
        "load_pump": {"relief_pressure", "enabled"},
        "oil_supply": {"pressure", "enabled", "temperature"},
    },
    "spring_bench": {
        "hydraulic_motor": {"speed", "enabled"},
        "valve_zp2": {"pressure", "enabled"},
        "cylinder": {"pressure", "enabled"},
        "testing_machine": {"travel", "enabled"},
        "oil_supply": {"temperature"},
    },
}


@pytest.fixture(scope="module")
def ros(tmp_path_factory):
    """A ROS domain of the file's own."""
    with pytest.MonkeyPatch.context() as patch, allocate() as held:
        patch.setenv("ROS_DOMAIN_ID", str(held.number))
        use_own_transports()
        rclpy.init(domain_id=held.number)
        yield
        rclpy.shutdown()


@pytest.mark.parametrize("name", PARAMETERS)
def test_each_device_has_the_topics_and_parameters_of_its_part(ros, name):
    config = load_rig(name)
    rig = rig_on_the_graph(config, devices="embedded")
    commands = Commands(Outputs(rig, run_record(config, BY_HAND, 1)))
    nodes = {one: DeviceNode(one, rig, commands) for one in device_names(config)}
    try:
        own = {one: set(node.settings.settings) for one, node in nodes.items() if hasattr(node, "settings")}
        assert own == PARAMETERS[name]
        described = nodes["oil_supply"].describe_parameter("temperature").description
        # as the part declares it
        assert described == "Temperature that the oil has as the rig starts, and takes at once when it is set [degC]"
        published = {topic for node in nodes.values() for topic in node.outputs}
        whole = {
            topic.name for topic in config.catalogue.topics.values() if topic.node in ("rig", "instruments", "alfa46", "sequencer")
        }
        assert published == set(config.catalogue.topics) - whole
        assert {topic for node in nodes.values() for topic in node.inputs} == {one.topic for one in setpoints_taken(config)}
    finally:
        for node in nodes.values():
            node.destroy_node()


def test_who_is_left_out_takes_nothing_and_time_comes_with_the_drive_where_there_is_no_controller():
    bench = load_rig("clutch_bench")
    assert "testing_machine" not in device_names(bench) and "testing_machine" in device_names(load_rig("spring_bench"))
    assert pace_of(bench).name == "/hydraulic_motor/state"
    assert pace_of(load_rig("three_speed")).name == "/instruments/controller"
