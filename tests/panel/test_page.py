# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The operator's page in a real browser, against the real graph, by mouse and keyboard."""

import io
import os
import re
import signal
import zipfile
from contextlib import closing
from pathlib import Path
from urllib.request import urlopen

import pytest
from browser import NEEDED, Browser
from started_panel import READY, Panel, choose

from rig_nodes.bags import Bag

pytestmark = [pytest.mark.against_the_clock, NEEDED]
OUTPUT = '[data-output="alfa46.output_1"]'
SAID = "document.getElementById('sequence-said').textContent"
# an order of a script, over a websocket of its own
ORDERED = (
    "new Promise((done) => {{ const s = new WebSocket(location.origin.replace('http', 'ws') + '/live'); s.onopen = () => "
    "{{ s.send(JSON.stringify({{do: 'fault', order: '{}'}})); setTimeout(() => s.close(), 500); done(); }}; }})"
)
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
    assert (
        page.js("getComputedStyle(document.querySelector('#shift-list [aria-pressed=true]')).backgroundColor") != "rgba(0, 0, 0, 0)"
    )
    page.until("Number(document.querySelector('#driveline .locked.flow').dataset.power) > 100")  # the second gear's losses, in W
    assert page.text("#shift-list").startswith("1: I -> II"), "the engagement from neutral is no shift"
    metrics = page.js("[...document.querySelectorAll('.metrics li')].map((one) => one.textContent)")
    assert any(re.fullmatch(r"t_c .*[0-9] ± [0-9]+ ms", one) for one in metrics), "as in the report, with name and error"
    assert any(
        "locked" in text for text in page.js("[...document.querySelectorAll('#driveline text')].map((one) => one.textContent)")
    )


MARKUP = "<img src=x onerror=alert(1)>"
MEASURED = f"Zeit [s];p1 [bar];{MARKUP}\n" + "".join(f"{0.01 * k:.2f};{10 + k},5;0\n".replace(".", ",") for k in range(20))


def test_a_measured_file_is_laid_over_the_shift_in_its_units_and_nothing_in_it_is_run(page, tmp_path):
    file = tmp_path / f"bench {MARKUP}.csv".replace("/", "")
    file.write_text(MEASURED, encoding="utf-8")
    page.give("#csv", file)
    said = "document.getElementById('csv-said')"
    page.until(f"{said}.textContent.startsWith('bench <img') && {said}.dataset.kind === ''")
    page.js("(() => { const s = document.getElementById('overlay-signal'); s.value = 'p1'; s.onchange(); })()")
    assert page.js("[...document.querySelectorAll('#overlay-chart .chip')].map((one) => one.innerText)") == ["shift 1", "measured"]
    assert page.js("document.querySelectorAll('img[src=x]').length") == 0
    file.write_text("nothing", encoding="utf-8")
    page.give("#csv", file)
    page.until(f"{said}.dataset.kind === 'refused'")
    assert str(tmp_path) not in page.text("#csv-said")


def test_no_value_is_a_dash_a_state_its_word_and_a_number_may_have_a_comma(page):
    of = "{known: new Map([['m', {states: {0: 'overruns', 2: 'holds'}}]])}"
    read = f"import('/static/charts.js').then(({{Charts}}) => [null, 0, 2].map((v) => Charts.prototype.read.call({of}, 'm', v)))"
    assert page.js(read) == ["\u2013", "overruns", "holds"]
    given = "[['0,5', 'K'], ['1e3', 'rpm'], ['5 bar', 'MPa'], ['', 'K']]"
    measure = f"import('/static/link.js').then(({{measure}}) => {given}.map((one) => measure(...one)))"
    assert page.js(measure) == ["0.5 K", "1e3 rpm", "5 bar", ""]


def test_held_charts_stay_as_they_are_and_a_gauge_goes_on(page):
    picture = "document.querySelector('.strip canvas').toDataURL()"
    page.write("#gauge", "n_wej")
    page.until("Number(document.querySelector('[data-gauge=n_wej] strong').textContent) > 900")
    assert page.js("document.querySelector('[data-gauge=n_wej] meter').value") > 900
    page.click("#pause")
    page.js("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    held, clock = page.js(picture), page.text("#clock")
    page.until(f"document.getElementById('clock').textContent !== '{clock}'")
    themes = []
    for _ in range(2):  # each has the charts built anew
        page.click("#theme")
        themes.append(page.js("document.documentElement.dataset.theme"))
        page.js("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert sorted(themes) == ["dark", "light"] and page.js(picture) == held
    page.click("#pause")
    page.until(f"{picture} !== '{held}'")


def test_a_load_is_given_as_torque_and_the_page_says_what_the_rig_makes_of_it(page):
    page.write(field("load_pump.torque"), "60")
    page.click(field("load_pump.enabled"))
    torque = "[...document.querySelectorAll('.chip')].find((one) => one.innerText.startsWith('M_wyj')).querySelector('.value')"
    page.until(f"Math.abs(Number({torque}.textContent) - 60) < 4")
    held = page.js(f"Number(document.querySelector('{field('load_pump.torque')}').value)")
    assert held == pytest.approx(60, abs=1) and page.text("[data-setting='load_pump.torque'] .said") == ""
    relief = page.js(f"Number(document.querySelector('{field('load_pump.relief_pressure')}').value)")
    page.write(field("motor.speed"), "1500")  # a relief valve gives more pressure at this speed (Annex D)
    page.until(f"Number(document.querySelector('{field('load_pump.torque')}').value) > {held} + 3")
    assert page.js(f"Number(document.querySelector('{field('load_pump.relief_pressure')}').value)") == relief
    page.write(field("load_pump.torque"), "900")
    said = "document.querySelector(\"[data-setting='load_pump.torque'] .said\").textContent"
    page.until(f"{said}.startsWith('load_pump.torque is 900 Nm, outside 0 to')")
    slider = "document.querySelector(\"[data-setting='load_pump.torque'] [type=range]\")"
    pulled = "for (const event of ['input', 'change']) s.dispatchEvent(new Event(event))"
    page.js(f"(() => {{ const s = {slider}; s.max = 900; s.value = 900; {pulled}; }})()")
    page.until(f"{said}.startsWith('load_pump.torque is 898.4 Nm, outside 0 to')")  # of the slider's steps
    page.until(f"Number({slider}.value) < 200")  # what the rig has
    page.write(field("load_pump.torque"), "60")
    page.click(field("load_pump.enabled"))
    page.write(field("motor.speed"), "1000")


def test_a_fault_is_switched_on_and_off(page):
    switch = "button[aria-label='T_oil.offset']"
    for state in ("on", "off"):
        page.click(switch)
        page.until(f'document.querySelector("{switch}").textContent === "{state}"')


def test_a_profile_that_is_dragged_is_what_the_rig_has_and_the_bag_holds(page, panel, tmp_path):
    point = f"document.querySelector('{OUTPUT} [aria-label$=\"P3, mA\"]').value"
    before = page.js(point)
    page.drag(f"{OUTPUT} [data-point='2']", 0, 12)
    after = page.until(
        f"(() => {{ const v = document.querySelector('{OUTPUT} [aria-label$=\"P3, mA\"]').value; "
        f"return v !== '{before}' && !document.querySelector('{OUTPUT} .wanted') && v; }})()"
    )
    assert float(after) < float(before) and page.text(f"{OUTPUT} .said") == ""
    page.click("[data-gear='1']")
    page.until("document.getElementById('shifting').textContent.startsWith('gear I after')")
    with urlopen(f"{panel.origin}/bag.zip?token={panel.token}&name=first") as answer:
        zipfile.ZipFile(io.BytesIO(answer.read())).extractall(tmp_path)
    bag = Bag(tmp_path / "first")  # it takes seconds to be put together, so the test before looks into no other one
    _, asked = bag.series("I_set_zr_p1")
    assert asked[-1] == pytest.approx(float(after) / 1e3, abs=1e-6)
    told = [name for *_, name, text, _ in bag.events() if text.startswith("T_oil.offset")]
    assert told == ["fault_ordered", "fault_on", "fault_ordered", "fault_off"]
    page.write(f'{OUTPUT} [aria-label$="P3, mA"]', "2000")
    page.until(f"document.querySelector('{OUTPUT} .said').dataset.kind === 'refused'")
    assert page.js("document.activeElement.value") == after, "not what the rig has refused"
    saved = tmp_path / "controller.yaml"
    with urlopen(f"{panel.origin}/controller.yaml?token={panel.token}") as answer:
        saved.write_bytes(answer.read())
    page.js(f"document.querySelector('{OUTPUT} [data-point=\"2\"]').focus()")
    page.key("ArrowUp")
    page.until(f"Number({point}) === {after} + 5 && !document.querySelector('{OUTPUT} .wanted')")
    page.write('[id="beside the curves set alfa46.t12"]', "0,15 s")
    page.until("document.querySelector('[id=\"set alfa46.t12\"]').value === '0.15'")
    page.give("#load-controller", saved)
    page.until(f"{point} === '{after}' && document.querySelector('[id=\"set alfa46.t12\"]').value !== '0.15'")


def test_a_value_that_is_refused_says_why_beside_the_hand(page):
    page.write(field("motor.speed"), "50000")
    said = "[data-setting='motor.speed'] .said"
    page.until(f'document.querySelector("{said}").textContent')
    assert page.text(said) == "motor.speed is 50000 rpm, outside 0 to 3000 rpm"
    page.write(field("motor.speed"), "1000")
    page.until(f"document.querySelector(\"{said}\").textContent === ''")


def test_of_the_settings_those_that_are_looked_for_are_shown(page):
    shown = "[...document.querySelectorAll('#setting-list .set')].filter((one) => one.offsetParent).map((one) => one.dataset.words)"
    page.js(
        "(() => { const f = document.getElementById('find'); f.value = 'temperature'; f.dispatchEvent(new Event('input')); })()"
    )
    found = page.js(shown)
    assert found and all("temperature" in words for words in found), "and not the others of their groups"
    page.js("(() => { const f = document.getElementById('find'); f.value = ''; f.dispatchEvent(new Event('input')); })()")


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
    page.until("!document.getElementById('reset').disabled")
    page.js("document.getElementById('theme').focus()")
    page.key("Tab")
    assert page.js("document.activeElement.id") == "reset"
    page.key("Enter")
    page.until(f"{STATE} === 'ready'")


def test_a_sequence_runs_with_its_progress_and_is_aborted(page):
    page.click("#run")
    page.until("document.getElementById('sequence-said').textContent.includes('of 14')")
    page.until("!document.getElementById('abort').disabled")
    page.click("#abort")
    page.until("document.getElementById('sequence-said').textContent.startsWith(\"sequence 'demo' was cancelled\")")


def test_a_second_page_sees_and_does_what_the_first_does(page, panel):
    page.write(field("motor.speed"), "750")
    with closing(Browser(panel.url)) as second:
        second.until(f"document.querySelector('{field('motor.speed')}').value === '750'")
        assert second.text("button[aria-label='T_oil.offset']") == "off", "it was told of the faults before it came"
        page.click(field("motor.speed"))
        page.js("document.activeElement.select()")
        page.call("Input.insertText", text="77")
        second.write(field("motor.speed"), "800")
        second.write(field("oil_supply.pressure"), "4.1")
        page.until(f"document.querySelector('{field('oil_supply.pressure')}').value === '4.1'")
        assert page.js(f"document.querySelector('{field('motor.speed')}').value") == "77", "a hand is typing there"
        page.js(f"document.querySelector('{field('motor.speed')}').value = ''")
        page.click("h1")
        page.until(f"document.querySelector('{field('motor.speed')}').value === '800'")
        second.click("#e_stop")
        page.until(f"{STATE} === 'emergency stop'")
        page.click("#reset")
        second.until(f"{STATE} === 'ready'")
        assert second.troubles == []
    page.until("document.getElementById('others').textContent.startsWith('Open pages: 1.')")


def test_a_trip_of_the_pages_own_doing_is_named_and_reset(page):
    page.click("[data-gear='1']")
    page.until("document.querySelector('[data-gear=\"1\"]').getAttribute('aria-pressed') === 'true'")
    page.click(field("motor.enabled"))
    page.until("document.querySelector('.chip .value').textContent > 300")
    page.write(field("oil_supply.pressure"), "0.2")  # which the clutches need
    page.until(f"{STATE} === 'tripped'")
    assert "pressure of oil_supply" in page.text("#reason")
    page.until(
        "[...document.querySelectorAll('#event-list .bad')].some((one) => one.textContent.includes('pressure of oil_supply'))"
    )
    page.write(field("oil_supply.pressure"), "4")
    page.click("#reset")
    page.until(f"{STATE} === 'ready' && document.getElementById('reason').hidden")


def test_a_series_that_is_not_there_and_a_rig_of_somebody_else_are_refused_with_the_reason(page, panel, tmp_path):
    switch, other = "button[aria-label='T_oil.offset']", "button[aria-label='p1.offset']"
    text_of = 'document.querySelector("{}").textContent'.format
    page.write("input[aria-label^='T_oil.offset:']", "0,5")
    page.click(switch)
    page.until(f"{text_of(switch)} === 'on'")
    page.js(ORDERED.format("p1.offset, at=1000 s"))
    page.until(f"{text_of(other)} === 'waits'")
    choose(page, "delay_series", "77")
    page.until(f"{SAID}.startsWith(\"procedure 'delay_series': there is no series '77'\")")
    joined = Panel(tmp_path, "--domain", str(panel.domain))
    try:
        second = Browser(joined.url)
        try:
            second.until("document.getElementById('sequence').options.length > 0", 60)
            second.until(f"{text_of(switch)} === 'on' && {text_of(other)} === 'waits'")  # from before it came
            for fault in (switch, other):
                second.click(fault)
                page.until(f"{text_of(fault)} === 'off'")
            second.click("#rec-pause")
            page.until("document.getElementById('rec-pause').textContent === 'Go on with the recording'")
            page.click("#rec-pause")
            second.until("document.getElementById('rec-pause').textContent === 'Pause the recording'")
            choose(second, "coast_down")
            second.until(f"{SAID}.startsWith('this page has joined a rig that somebody else starts')")
        finally:
            second.close()
    finally:
        joined.close()
    assert page.text("#state") != "away", "the rig was not stopped"


def children(pid) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def rig_of(panel) -> int:
    """Returns the process `rig run` of a page."""
    return next(pid for pid in children(panel.process.pid) if b"\0run\0" in Path(f"/proc/{pid}/cmdline").read_bytes())


def test_a_controller_that_is_started_again_has_its_first_profiles_and_the_page_shows_them(page, panel):
    time = f"document.querySelector('{OUTPUT} [aria-label$=\"P2, ms\"]').value"
    before = page.js(time)
    page.write(f'{OUTPUT} [aria-label$="P2, ms"]', "400")
    page.until(f"{time} === '400' && !document.querySelector('{OUTPUT} .wanted')")
    processes = [pid for server in children(rig_of(panel)) for pid in children(server)]
    os.kill(next(pid for pid in processes if Path(f"/proc/{pid}/comm").read_text() == "alfa46\n"), signal.SIGKILL)
    page.until(f"{time} === '{before}'")
    page.until(f"{STATE} === 'tripped'")
    page.click("#reset")
    page.until(f"{STATE} === 'ready'")


def test_an_order_says_that_it_waits_for_the_rig_and_how_old_the_samples_are(page, panel):
    switch, said = field("oil_supply.enabled"), "document.querySelector(\"[data-setting='oil_supply.enabled'] .said\").textContent"
    before = page.text(switch)
    stopped = [pid for server in children(rig_of(panel)) for pid in children(server)]
    try:
        for pid in stopped:
            os.kill(pid, signal.SIGSTOP)
        page.click(switch)
        page.click("[data-gear='1']")
        for place in (said, "document.getElementById('shifting').textContent"):
            page.until(f"{place} === 'asked'")
        assert page.js(f"document.querySelector('{switch}').getAttribute('aria-busy')") == "true"
        page.until("document.getElementById('clock').textContent.endsWith('; nothing new for 2 s')")
        page.until(f"{said} === 'asked; the rig has not answered for 5 s'")
        assert page.text(switch) == before, "it shows what the rig has"
    finally:
        for pid in stopped:
            os.kill(pid, signal.SIGCONT)
    page.until(f"document.querySelector('{switch}').textContent !== '{before}' && {said} === ''")
    page.until("!document.getElementById('clock').textContent.includes('nothing new')")
    page.until(f"{STATE} === 'tripped'")  # the controller was silent
    page.click("#reset")
    page.until("document.getElementById('said').textContent")
    page.until(f"{STATE} === 'ready'")


def test_the_rig_is_started_again_under_the_page(page, panel):
    page.js("(() => { const s = document.getElementById('sequence'); s.value = 'sequence demo'; s.onchange(); })()")
    page.click("#run")
    page.until(f"{SAID}.includes('of 14')")
    os.kill(rig_of(panel), signal.SIGINT)
    page.until(f"{STATE} === 'away' && !document.getElementById('start').hidden", 60)
    page.until("document.getElementById('sequence-said').dataset.kind === 'refused' && document.getElementById('progress').hidden")
    page.until("document.getElementById('reason').textContent === 'the rig has ended'")
    page.click("#start")
    page.until(READY, 60)
    page.until("document.querySelectorAll('#event-list li').length < 5", 30)  # those of the rig before are gone
    page.write(field("motor.speed"), "500")
    page.click(field("motor.enabled"))
    page.until("document.querySelector('.chip .value').textContent > 400", 60)
