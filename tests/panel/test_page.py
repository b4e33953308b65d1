# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The operator's page in a real browser, against the real graph, by mouse and keyboard."""

import io
import zipfile
from urllib.request import urlopen

import pytest

from rig_nodes.bags import Bag

pytestmark = pytest.mark.against_the_clock
OUTPUT = '[data-output="alfa46.output_1"]'
STATE = "document.getElementById('state').textContent"


def field(name: str) -> str:
    """Returns the selector of a setting's field."""
    return f'[id="set {name}"]'


def test_a_first_shift_is_made_from_nothing_and_is_judged(page):
    page.write(field("oil_supply.pressure"), "4")
    page.click(field("oil_supply.enabled"))
    page.until(f"document.querySelector('{field('oil_supply.enabled')}').textContent === 'on'")
    page.click("[data-gear='1']")
    page.until("document.getElementById('shifting').textContent.startsWith('gear I after')")
    page.write(field("motor.speed"), "1000")
    page.click(field("motor.enabled"))
    page.until("document.querySelector('.chip .value').textContent > 990", 60)
    page.click("[data-gear='2']")
    page.until("document.querySelector('[data-gear=\"2\"]').getAttribute('aria-pressed') === 'true'")
    page.until("document.querySelector('#shift img')?.naturalWidth > 0", 60)
    assert page.text("#shift strong") in ("good", "fair", "poor", "no verdict"), "none where a busy machine left gaps"
    assert "Upshift I → II" in page.text("#shift p")
    assert any(
        "locked" in text for text in page.js("[...document.querySelectorAll('#driveline text')].map((one) => one.textContent)")
    )


def test_a_profile_that_is_dragged_is_what_the_rig_has_and_the_bag_holds(page, panel, tmp_path):
    before = page.js(f"document.querySelector('{OUTPUT} [aria-label$=\"P3, mA\"]').value")
    page.drag(f"{OUTPUT} [data-point='2']", 0, 12)
    after = page.until(
        f"(() => {{ const v = document.querySelector('{OUTPUT} [aria-label$=\"P3, mA\"]').value; "
        f"return v !== '{before}' && !document.querySelector('{OUTPUT} .wanted') && v; }})()"
    )
    assert float(after) < float(before) and page.text(f"{OUTPUT} .bad") == ""
    page.click("[data-gear='1']")
    page.until("document.getElementById('shifting').textContent.startsWith('gear I after')")
    with urlopen(f"{panel.origin}/bag.zip?token={panel.token}&name=first") as answer:
        zipfile.ZipFile(io.BytesIO(answer.read())).extractall(tmp_path)
    _, asked = Bag(tmp_path / "first").series("I_set_zr_p1")
    assert asked[-1] == pytest.approx(float(after) / 1e3, abs=1e-6)


def test_a_value_that_is_refused_says_why_beside_the_hand(page):
    page.write(field("motor.speed"), "50000")
    said = "[data-setting='motor.speed'] .bad"
    page.until(f'document.querySelector("{said}").textContent')
    assert page.text(said) == "motor.speed is 50000 rpm, outside 0 to 3000 rpm"
    page.write(field("motor.speed"), "1000")
    page.until(f"document.querySelector(\"{said}\").textContent === ''")


def test_the_keyboard_orders_a_gear_and_stops_the_rig(page):
    page.js("document.getElementById('theme').focus()")
    for _ in range(40):
        page.key("Tab")
        if page.js("document.activeElement.dataset.gear") == "1":
            break
    page.key("Enter")
    page.until("document.querySelector('[data-gear=\"1\"]').getAttribute('aria-pressed') === 'true'")
    page.key("Escape")
    page.until(f"{STATE} === 'emergency stop'")
    page.click("#reset")
    page.until(f"{STATE} === 'ready'")


def test_a_sequence_runs_with_its_progress_and_is_aborted(page):
    page.click("#run")
    page.until("document.getElementById('sequence-said').textContent.includes('of 14')")
    page.until("!document.getElementById('abort').disabled")
    page.click("#abort")
    page.until("document.getElementById('sequence-said').textContent.startsWith(\"sequence 'demo' was cancelled\")")
