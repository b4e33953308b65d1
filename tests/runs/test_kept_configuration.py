# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files that ship with the package are read once and kept between processes, each file under a name of its own."""

import importlib.metadata
import pathlib
import pickle

import pytest

import rig_nodes.base.keep
from rig_nodes.base import config
from rig_nodes.base.versions import version_of
from rig_nodes.rig import signal_catalogue
from rig_nodes.rig.configuration import load_rig


def test_files_named_alike_are_kept_side_by_side_and_not_read_again(tmp_path, monkeypatch):
    alike = [config.RIGS_DIR / name / "rig.yaml" for name in ("hydmag", "clutch_bench")]
    monkeypatch.setattr(rig_nodes.base.keep, "cache_root", lambda: tmp_path / "kernel-cache")
    config._parsed.cache_clear()
    first = [config.load_yaml(path) for path in alike]
    assert len(list((tmp_path / "read-configuration").iterdir())) == 2
    config._parsed.cache_clear()  # as in another process
    monkeypatch.setattr(config, "read_yaml", None)
    assert [config.load_yaml(path) for path in alike] == first and first[0] != first[1]


def test_an_edited_file_is_read_anew_and_takes_the_place_of_the_old(tmp_path, monkeypatch):
    monkeypatch.setattr(config, "CONFIG_DIR", tmp_path / "config")
    monkeypatch.setattr(rig_nodes.base.keep, "cache_root", lambda: tmp_path / "cache" / "kernel-cache")
    path = tmp_path / "a.yaml"
    for text, value in (("a: 1", {"a": 1}), ("a: 23", {"a": 23})):
        path.write_text(text)
        assert config.load_yaml(path) == value
        assert len(list((tmp_path / "cache" / "read-configuration").iterdir())) == 1


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """Returns the file in which the content of an installed one is kept, and a way to read it as another process would."""
    monkeypatch.setattr(rig_nodes.base.keep, "cache_root", lambda: tmp_path / "kernel-cache")

    def read():
        config._parsed.cache_clear()
        return config.load_yaml(config.RIGS_DIR / "hydmag" / "sequences" / "demo.yaml")

    read()
    return tmp_path / "read-configuration" / "rigs-hydmag-sequences-demo.json", read


class Planted:
    """An object whose code runs when it is unpickled."""

    def __reduce__(self):
        return (pathlib.Path.touch, (pathlib.Path("it-ran"),))


def damaged(content: bytes):
    """Returns possible contents in the place of the kept file."""
    yield from (b"", content[:-7], content[: len(content) // 2], b"[" * 100_000, b"null", b"{}", b"\xff\xfe")
    yield content.replace(b"1500 rpm", b"9999 rpm")
    yield content.partition(b"\n")[0] + b"\nnull"
    yield pickle.dumps(Planted())


def test_a_damaged_or_planted_file_is_made_anew_without_a_word(kept, tmp_path, monkeypatch, capsys):
    path, read = kept
    monkeypatch.chdir(tmp_path)
    right, content = read(), path.read_bytes()
    for k, wrong in enumerate(damaged(content)):
        path.write_bytes(wrong)
        assert read() == right, k
        assert path.read_bytes() == content, k
    assert not (tmp_path / "it-ran").exists() and capsys.readouterr() == ("", "")


def test_what_lies_in_a_folder_that_others_can_write_is_not_taken(kept):
    path, read = kept
    right = read()
    path.write_bytes(b"planted")
    path.parent.chmod(0o777)
    assert read() == right and path.read_bytes() == b"planted", "neither read nor written"


def test_lines_are_kept_too(kept):
    _, read = kept
    node = read()
    rows = (config.RIGS_DIR / "hydmag" / "sequences" / "demo.yaml").read_text().splitlines()
    assert rows[node.lines["steps"]].startswith("steps:") and rows[node["steps"].lines[1]].lstrip().startswith("- ")


def test_the_topics_of_all_rigs_are_read_once_and_anew_where_a_rig_changes(tmp_path, monkeypatch):
    monkeypatch.setattr(rig_nodes.base.keep, "cache_root", lambda: tmp_path / "kernel-cache")
    monkeypatch.setattr(signal_catalogue, "__file__", str(tmp_path / "package" / "rig/signal_catalogue.py"))
    rig = tmp_path / "package" / "rigs" / "own" / "rig.yaml"
    rig.parent.mkdir(parents=True)
    read, reading = [], signal_catalogue._read_topics

    def counted():
        read.append(rig.read_text())
        return reading()

    monkeypatch.setattr(signal_catalogue, "_read_topics", counted)
    try:
        for text in ("one", "one", "another"):
            rig.write_text(text)
            signal_catalogue.installed_topics.cache_clear()  # as in another process
            topics = signal_catalogue.installed_topics()
        assert read == ["one", "another"]
        for name in ("hydmag", "chain_saw"):
            assert load_rig(name).catalogue.all_topics.items() <= topics.items()
    finally:
        signal_catalogue.installed_topics.cache_clear()


def test_versions_are_those_of_the_installed_packages():
    for package in ("numba", "numpy", "rosbags", "ruamel.yaml"):
        assert version_of(package) == importlib.metadata.version(package)
    with pytest.raises(importlib.metadata.PackageNotFoundError):
        version_of("no-such-package")
