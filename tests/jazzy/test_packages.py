"""What ROS expects of a package beside its code."""

import re
import xml.etree.ElementTree as xml
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("folder", ["rig_nodes", "msgs"])
def test_a_package_says_what_changed_up_to_its_version(folder):
    package = xml.parse(CHECKOUT / folder / "package.xml").getroot()
    name, version = package.findtext("name"), package.findtext("version")
    log = (CHECKOUT / folder / "CHANGELOG.rst").read_text(encoding="utf-8")
    assert f"Changelog for package {name}\n" in log and re.search(rf"^{re.escape(version)}\n-----$", log, re.M)
    assert package.findtext("license") == "Apache-2.0" and package.find("maintainer").get("email")
