# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files that ROS expects in a package beside its code."""

import re
import xml.etree.ElementTree as xml
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
SUFFIXES = (".py", ".c", ".h", ".cpp", ".hpp")
# the form that ament_copyright finds, which may follow a line for the shell
RIGHTS = re.compile(r"(#!.*\n)?(/\*\n)?(#|//| \*) Copyright \d{4} \S.*\n\3 SPDX-License-Identifier: Apache-2\.0\n")


def test_every_source_file_says_whose_it_is_and_under_which_licence():
    files = [
        path
        for folder in ("rig_nodes", "msgs", "tests")
        for path in (CHECKOUT / folder).rglob("*")
        if path.suffix in SUFFIXES and not {"build", "install"} & set(path.parts)
    ]
    assert len(files) > 400
    without = [path for path in files if not RIGHTS.match(path.read_text(encoding="utf-8"))]
    assert [str(path.relative_to(CHECKOUT)) for path in without] == []


@pytest.mark.parametrize("folder", ["rig_nodes", "msgs"])
def test_a_package_says_what_changed_up_to_its_version(folder):
    package = xml.parse(CHECKOUT / folder / "package.xml").getroot()
    name, version = package.findtext("name"), package.findtext("version")
    log = (CHECKOUT / folder / "CHANGELOG.rst").read_text(encoding="utf-8")
    assert f"Changelog for package {name}\n" in log and re.search(rf"^{re.escape(version)}\n-----$", log, re.M)
    assert package.findtext("license") == "Apache-2.0" and package.find("maintainer").get("email")
