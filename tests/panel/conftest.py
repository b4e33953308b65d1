# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The operator's page as its user starts it, and a browser on it."""

import sys
from contextlib import closing
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from browser import Browser
from started_panel import READY, Panel

from rig_nodes.controllers import allocate


@pytest.fixture(scope="module")
def panel(tmp_path_factory):
    """A page that has started HydmAG, the rig of whoever names none, in the ROS domain of its user, where no rig runs."""
    folder = tmp_path_factory.mktemp("panel")
    with allocate() as domain, closing(Panel(folder, "--faults", ROS_DOMAIN_ID=str(domain.number))) as panel:
        assert panel.domain == domain.number
        yield panel
        assert panel.process.poll() is None, "it has ended by itself"


@pytest.fixture(scope="module")
def page(panel):
    """A browser on it, with the rig ready."""
    with closing(Browser(panel.url)) as browser:
        browser.until(READY, 200)  # the first start compiles the plant
        yield browser
        assert browser.troubles == [], "no script of the page has failed"
