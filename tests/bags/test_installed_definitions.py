# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a bag says about a user's message package is what ROS 2 says: rosidl's own names of types and its own hash."""

import contextlib
import io
import json
import struct
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_share_directory
from rosidl_adapter.msg import convert_msg_to_idl
from rosidl_generator_type_description import generate_type_hash

import rig_nodes.base.keep
from rig_nodes.bags import cdr, definitions
from rig_nodes.bags.definitions import installed, parse
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.writer import BagWriter
from rig_nodes.base.names import installed as installed_rigs
from rig_nodes.rig import load_rig

MESSAGES = {"Header": "uint32 stamp\nfloat64 v\n", "S": "# what it is\nHeader own\nHeader[2] two\nfloat64 w\n"}


@pytest.fixture
def my_pkg(tmp_path, monkeypatch):
    """The share folder of an installed package with a Header of its own, made by rosidl's own tools."""
    share = tmp_path / "share" / "my_pkg"
    (share / "msg").mkdir(parents=True)
    index = tmp_path / "share" / "ament_index" / "resource_index" / "packages"
    index.mkdir(parents=True)
    (index / "my_pkg").touch()
    for name, text in MESSAGES.items():
        (share / "msg" / f"{name}.msg").write_text(text)
        with contextlib.redirect_stdout(io.StringIO()):
            convert_msg_to_idl(share, "my_pkg", Path("msg") / f"{name}.msg", share / "msg")
    arguments = tmp_path / "arguments.json"
    files = [f"{share}:msg/{name}.idl" for name in MESSAGES]
    arguments.write_text(json.dumps({"package_name": "my_pkg", "output_dir": str(share), "idl_tuples": files}))
    generate_type_hash(str(arguments))
    monkeypatch.setattr(rig_nodes.base.keep, "cache_root", lambda: tmp_path / "kernel-cache")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    yield share
    for function in (definitions.installed, definitions._text_of, definitions._kept, definitions.parse):
        function.cache_clear()


def test_a_package_with_a_header_of_its_own_is_recorded_with_that_definition_and_rosidls_hash(my_pkg, tmp_path):
    found = installed("my_pkg/msg/S")
    _, head, header = found.text.partition("=" * 80 + "\nMSG: ")
    assert head and header.startswith("my_pkg/Header\nuint32 stamp") and "std_msgs" not in found.text
    hashes = {one["type_name"]: one["hash_string"] for one in json.loads((my_pkg / "msg" / "S.json").read_text())["type_hashes"]}
    assert found.type_hash == hashes["my_pkg/msg/S"]
    data = b"\x00\x01\x00\x00" + struct.pack("<IxxxxdIxxxxdIxxxxdd", 7, 1.5, 8, 2.5, 9, 3.5, 4.5)
    with BagWriter(tmp_path / "bag", "mine") as writer:
        writer.write("/mine/s", "my_pkg/msg/S", cdr.exact(found, data), 5)
    ((_, message),) = Bag(tmp_path / "bag").messages("/mine/s")
    assert (message.own.stamp, message.own.v, message.two[1].stamp, message.w) == (7, 1.5, 9, 4.5)


def test_such_a_bag_is_read_where_the_package_is_not_installed():
    text = f"{MESSAGES['S']}{'=' * 80}\nMSG: my_pkg/Header\n{MESSAGES['Header']}"
    tree = dict(parse("my_pkg/msg/S", text).tree.fields)
    assert tree["own"].name == tree["two"].item.name == "my_pkg/msg/Header"
    other = f"Header header\n{'=' * 80}\nMSG: std_msgs/Header\nuint32 seq\n"  # as tools of ROS 1 abbreviate it
    assert dict(parse("my_pkg/msg/Other", other).tree.fields)["header"].name == "std_msgs/msg/Header"


def package_of(ros_type):
    """Where ROS 2 has a message, which the rig's own text of it must equal."""
    package, _, name = ros_type.split("/")
    return Path(get_package_share_directory(package)) / "msg" / f"{name}.msg"


OWN = sorted(str(path.relative_to(definitions.INTERFACES).with_suffix("")) for path in definitions.INTERFACES.glob("*/msg/*.msg"))


@pytest.mark.parametrize("ros_type", OWN)
def test_a_type_that_the_rig_brings_along_is_that_of_ros(ros_type):
    assert package_of(ros_type).read_bytes() == definitions.message_file(ros_type).read_bytes()
    described = json.loads(package_of(ros_type).with_suffix(".json").read_text())["type_hashes"]
    assert installed(ros_type).type_hash == next(one["hash_string"] for one in described if one["type_name"] == ros_type)


def test_every_type_that_a_run_records_is_brought_along(monkeypatch):
    monkeypatch.delenv("AMENT_PREFIX_PATH")
    types = {topic.ros_type for name in installed_rigs("rigs") for topic in load_rig(name).catalogue.topics.values()}
    assert len(types) > 10 and all(definitions.message_file(one).is_relative_to(definitions.INTERFACES) for one in types)


@pytest.mark.parametrize("ros_type", ["std_msgs/msg/Empty", "diagnostic_msgs/msg/DiagnosticArray"])
def test_the_hash_of_an_installed_type_is_that_of_its_text_too(ros_type):
    found = installed(ros_type)
    assert definitions._parsed(ros_type, found.text)[1] == found.type_hash
