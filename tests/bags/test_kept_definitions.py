# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Definitions of installed messages are read once and kept between processes, as long as their files are the same."""

import pytest

import rig_nodes.base.keep
from rig_nodes.bags import definitions
from rig_nodes.bags.definitions import installed, parse

NAME = "rig_msgs/msg/RigState"


@pytest.fixture
def another_process(tmp_path, monkeypatch):
    """Returns a function that clears the definitions kept in this process; those on disk are in a folder of the test's own."""
    monkeypatch.setattr(rig_nodes.base.keep, "cache_root", lambda: tmp_path / "kernel-cache")

    def forget():
        for function in (definitions.installed, definitions._text_of, definitions._kept, definitions.parse):
            function.cache_clear()

    forget()
    yield forget
    forget()


def test_a_kept_definition_is_the_one_that_was_read(another_process, monkeypatch):
    first = installed(NAME)
    another_process()
    monkeypatch.setattr(definitions, "get_types_from_msg", None)
    second = installed(NAME)
    assert (second.text, second.type_hash, second.tree, second.leaves, second.tail, second.size) == (
        first.text,
        first.type_hash,
        first.tree,
        first.leaves,
        first.tail,
        first.size,
    )
    assert parse(NAME, first.text).tree == first.tree, "a bag with the installed text needs no reading either"


def test_a_bag_with_another_text_is_read_by_its_own(another_process):
    text = "std_msgs/Header header\nuint64 seq\nfloat64 other\n" + installed("rig_msgs/msg/Measurement").text.partition("=" * 80)[2]
    head, _, rest = text.partition("MSG:")
    found = parse("rig_msgs/msg/Measurement", f"{head}{'=' * 80}\nMSG:{rest}")
    assert [name for name, _ in found.tree.fields] == ["header", "seq", "other"]


def test_an_edited_message_is_read_anew(another_process, tmp_path, monkeypatch):
    share = tmp_path / "share" / "mine" / "msg"
    share.mkdir(parents=True)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    for text, names in (("float64 a\n", ["a"]), ("float64 a\nfloat64 bb\n", ["a", "bb"])):
        (share / "Own.msg").write_text(text)
        another_process()
        assert [name for name, _ in installed("mine/msg/Own").tree.fields] == names
