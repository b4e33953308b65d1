# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller that is plugged in, on the operator's page: which it is, its state, its own signals and settings."""

import pytest
from browser import Browser
from started_panel import Panel

pytestmark = pytest.mark.against_the_clock
BOX = """
from rig_nodes.controllers import ControllerOutputs


class Box:
    levels, signals, settings = ("current",), {"since_order": "s"}, {"held": 0.74}

    def initialize(self, info):
        self.gear, self.since, self.outputs = 0, -10.0, len(info.outputs)

    def step(self, inputs):
        if inputs.gear_request != self.gear:
            self.gear, self.since = inputs.gear_request, inputs.time
        command = [inputs.settings["held"] if self.gear == k + 1 else 0.0 for k in range(self.outputs)]
        out = ControllerOutputs(command, gear=self.gear)
        out.signals = {"since_order": inputs.time - self.since}
        return out

    def terminate(self):
        pass
"""


def test_a_users_controller_is_named_with_its_state_and_its_own_signals(tmp_path):
    file = tmp_path / "box.py"
    file.write_text(BOX, encoding="utf-8")
    own = "document.querySelector('[data-own=\"controller.since_order\"] td')"
    panel = Panel(tmp_path, "hydmag", "--faults", "--controller", f"python:{file}:Box")
    browser = Browser(panel.url)
    try:
        browser.until("document.getElementById('state').textContent === 'ready'", 200)
        browser.until(f"Number({own}.textContent) > 10")  # it counts from 10 s before its start
        browser.until("document.getElementById('controller-state').textContent.endsWith('Box: answers the samples')")
        browser.click("[data-gear='1']")
        browser.until(f"Number({own}.textContent) < 10", 10)
        browser.until("[...document.querySelectorAll('#controller-list tr')].some((row) => row.innerText === 'gear\\tI')")
        browser.click("[aria-label='chart of controller.since_order']")
        chip = "[...document.querySelectorAll('.chip')].find((one) => one.innerText.startsWith('controller.since_order'))"
        browser.until(f"Number({chip}.querySelector('.value').textContent) > 1")
        second = Browser(panel.url, 400, 800)
        try:
            second.until(f"Number({own}.textContent) > 1")
            second.until("Number(document.querySelector('[id=\"set alfa46.controller.held\"]').value) === 0.74")
            assert second.js("document.documentElement.scrollWidth") <= 400, "nothing goes beyond the edge of a phone"
        finally:
            second.close()
        assert browser.troubles == []
    finally:
        browser.close()
        panel.close()
