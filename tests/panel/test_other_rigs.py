# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The operator's page of other rigs, for none of which it has a line of its own: each is driven, and a signal is seen to move."""

from contextlib import closing

import pytest
from browser import NEEDED, Browser
from started_panel import Panel

from rig_nodes.cli.main import main

pytestmark = [pytest.mark.against_the_clock, NEEDED]
SETPOINT = '[id="set {}"]'
LONGER = pytest.mark.campaign


@pytest.mark.parametrize(
    ("rig", "device", "setting", "value", "signal", "least"),
    [
        ("three_speed", "motor", "speed", "600", "n_in", 500),
        pytest.param("clutch_bench", "hydraulic_motor", "speed", "60", "n", 10, marks=LONGER),
        pytest.param("frame_saw", "motor_drive", "speed", "300", "n_crank", 80, marks=LONGER),
        pytest.param("chain_saw", "trigger", "throttle", "0.5", "throttle", 45, marks=LONGER),
        pytest.param("new", "motor", "speed", "600", "n_in", 500, marks=LONGER),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_it_is_driven_from_its_page(tmp_path, rig, device, setting, value, signal, least):
    if rig == "new":
        rig = str(tmp_path / "new")
        assert main(["new", "rig", rig]) == 0
    with closing(Panel(tmp_path, rig)) as panel, closing(Browser(panel.url)) as browser:
        browser.until("document.getElementById('state').textContent === 'ready'", 200)
        browser.write(SETPOINT.format(f"{device}.{setting}"), value)
        browser.click(SETPOINT.format(f"{device}.enabled"))
        moving = f"[...document.querySelectorAll('.chip')].find((one) => one.innerText.startsWith('{signal}'))"
        browser.until(f"Number({moving}.querySelector('.value').textContent) > {least}")
        assert browser.text("#driveline").strip(), "it has a picture of its own"
        loads = browser.js("document.querySelectorAll('[data-setting$=relief_pressure]').length")
        assert loads == browser.js("document.querySelectorAll('#setpoints [data-setting$=torque]').length"), "each in Nm too"
        assert browser.js("document.querySelectorAll('#setpoints .said[data-kind=refused]').length") == 0
        browser.js("document.querySelector('#sequences details').open = true")
        browser.click("#run-own")  # of the steps that the page proposes
        browser.until("document.getElementById('own-said').textContent.startsWith(\"sequence 'own' is done\")", 60)
        value = "document.querySelector('#steps .step input:not([hidden])').value"
        saved = browser.js(value)
        browser.js(f"(() => {{ {value} = '0,5 s'; }})()")
        browser.click("#run-own")
        browser.until("document.getElementById('own-said').textContent.startsWith(\"there is another sequence 'own' already\")")
        browser.click("#load-own")
        browser.until("document.getElementById('own-said').textContent === \"'own' is taken up\"")
        assert browser.js(value) == saved and browser.js("document.getElementById('replace').checked")
        assert "own sequence own" in browser.js("[...document.getElementById('sequence').options].map((one) => one.value)")
        hidden = "document.querySelector(one.hash).hidden"
        assert browser.js(f"[...document.querySelectorAll('nav a')].every((one) => one.hidden === {hidden})"), "no link to nothing"
        assert browser.troubles == []
