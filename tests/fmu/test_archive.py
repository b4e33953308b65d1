# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Invalid archives and descriptions: each is refused in one sentence, and no file of it is written."""

import stat
import zipfile

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.controllers.fmi import archive
from rig_nodes.controllers.fmi.archive import unpack
from rig_nodes.controllers.fmi.importer import Fmu

XML = b'<?xml version="1.0"?><fmiModelDescription fmiVersion="2.0" modelName="m" guid="g"/>'
LAUGHS = b"""<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">
<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">]><fmiModelDescription>&c;</fmiModelDescription>"""


def entry(name, data=b"x", mode=stat.S_IFREG | 0o644, method=zipfile.ZIP_DEFLATED):
    info = zipfile.ZipInfo("place")
    info.filename = name
    info.external_attr, info.compress_type = mode << 16, method
    return info, data


def written(path, entries, xml=XML):
    with zipfile.ZipFile(path, "w") as file:
        for info, data in [*([entry("modelDescription.xml", xml)] if xml is not None else []), *entries]:
            file.writestr(info, data)
    return path


@pytest.mark.parametrize(
    ("entries", "sentence"),
    [
        ([entry("/etc/own.conf")], r"the entry '/etc/own.conf', an absolute path; expected paths inside the FMU"),
        ([entry("C:/own.dll")], "the entry 'C:/own.dll', an absolute path"),
        ([entry("resources/../../own")], "the entry 'resources/../../own', which leads out of it"),
        ([entry("binaries\\own.dll")], "with a character that no path in an FMU has"),
        ([entry("a\x1b[31mb")], r"the entry 'a\\u001b\[31mb', with a character"),
        ([entry("x" * 300)], "which is too long"),
        ([entry("binaries/link", b"/etc/passwd", stat.S_IFLNK | 0o777)], "entry 'binaries/link' is a symbolic link"),
        ([entry("binaries/pipe", b"", stat.S_IFIFO | 0o644)], "entry 'binaries/pipe' is no ordinary file"),
        ([entry("resources/zeros", bytes(20_000_000))], r"entry 'resources/zeros' unpacks to \d+ times its size, at most 200"),
        ([entry("resources/packed", method=zipfile.ZIP_LZMA)], "packed by a method that FMI does not allow"),
        ([entry(f"resources/{k}", b"") for k in range(10_001)], "has 10002 entries, expected at most 10000"),
        ([entry("same", b"1"), entry("same", b"2")], "has the entry 'same' twice"),
        ([entry("both", b"1"), entry("both/inside", b"2")], "has 'both' as a file and as a folder"),
    ],
)
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_an_archive_that_leads_astray_is_refused_before_anything_is_written(entries, sentence, tmp_path):
    path, folder = written(tmp_path / "bad.fmu", entries), tmp_path / "unpacked"
    folder.mkdir()
    with pytest.raises(RigError, match=sentence.replace("size, at", "size, expected at")) as refusal:
        unpack(path, folder)
    assert "\n" not in str(refusal.value) and list(folder.iterdir()) == []
    with pytest.raises(RigError, match="^.*bad.fmu: it cannot be read as an FMU: its archive"):
        Fmu(path)


def test_a_size_is_refused_that_is_declared_and_one_that_is_hidden(tmp_path, monkeypatch):
    monkeypatch.setattr(archive, "MOST_BYTES", 5000)
    folder = tmp_path / "unpacked"
    folder.mkdir()
    with pytest.raises(RigError, match="unpacks to 0 MB, expected at most 0 MB"):
        unpack(written(tmp_path / "large.fmu", [entry("a", bytes(3000)), entry("b", bytes(3000))]), folder)
    path = written(tmp_path / "hidden.fmu", [entry("a", bytes(300_000))])
    data = bytearray(path.read_bytes())
    size = (300_000).to_bytes(4, "little")
    while (at := data.find(size)) >= 0:  # the file's own header and the archive's list both state 100 bytes
        data[at : at + 4] = (100).to_bytes(4, "little")
    path.write_bytes(data)
    with pytest.raises(RigError, match="it is damaged at 'a'"):
        unpack(path, folder)
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize(
    ("xml", "sentence"),
    [
        (LAUGHS, "has a document type declaration"),
        (b"<a>" * 300 + b"</a>" * 300, "is nested deeper than 50 elements"),
        (b"<a>%s</a>" % b"".join(b"<b%x/>" % k for k in range(10_001)), "has more than 10000 elements"),
        (XML[:60], "is no well-formed XML: "),
        (b"\xff\xfe\x00", "is no well-formed XML: "),
        (b"", "is no well-formed XML: no element found"),
        (None, "its archive has no modelDescription.xml"),
    ],
)
def test_a_description_without_end_or_sense_is_refused(xml, sentence, tmp_path, monkeypatch):
    monkeypatch.setattr(archive, "MOST_ELEMENTS", 10_000)
    with pytest.raises(RigError, match=f"bad.fmu: it cannot be read as an FMU: .*{sentence}") as refusal:
        Fmu(written(tmp_path / "bad.fmu", [], xml))
    assert "\n" not in str(refusal.value)


def test_a_description_of_a_hundred_megabytes_is_refused_before_it_is_unpacked(tmp_path):
    xml = entry("modelDescription.xml", bytes(105_000_000), method=zipfile.ZIP_STORED)
    with pytest.raises(RigError, match="its modelDescription.xml has 105 MB, expected at most 34 MB"):
        Fmu(written(tmp_path / "bad.fmu", [xml], None))


def test_an_archive_that_is_cut_off_is_refused(tmp_path):
    path = written(tmp_path / "cut.fmu", [entry("resources/x", b"y" * 1000)])
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(RigError, match="it is no whole zip archive: "):
        Fmu(path)
