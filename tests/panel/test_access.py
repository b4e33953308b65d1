# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Who has access to the operator's page: loopback, its own Host and Origin, with the token; and no message harms it."""

import asyncio
import json
import random
import urllib.error
import urllib.request

import pytest
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

pytestmark = pytest.mark.against_the_clock
MANY = 10_000


def status(url: str, **headers: str) -> int:
    """Returns the status of an answer."""
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers)) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


@pytest.mark.parametrize(
    "path", ["/", "/static/panel.js", "/live", "/controller.yaml", "/measured", "/bag.zip", "/shift/1/wide_light.svg", "/no"]
)
def test_nothing_is_served_without_the_token_or_to_another_host_or_origin(panel, path):
    with_token = f"{panel.origin}{path}?token={panel.token}"
    assert status(f"{panel.origin}{path}") == 403
    wrong = "xy"[panel.token[0] == "x"] + panel.token[1:]
    assert status(f"{panel.origin}{path}?token={wrong}") == 403
    for host in ("evil.example", f"evil.example:{panel.port}", "127.0.0.1", f"127.0.0.1.evil.example:{panel.port}", ""):
        assert status(with_token, Host=host) == 403
    for origin in ("http://evil.example", "null", f"https://127.0.0.1:{panel.port}", f"http://127.0.0.1:{panel.port + 1}"):
        assert status(with_token, Origin=origin) == 403


def test_the_address_that_is_printed_is_served_with_its_origin(panel):
    assert status(panel.url) == status(panel.url, Origin=panel.origin) == 200
    with urllib.request.urlopen(panel.url) as answer:
        assert "SameSite=Strict" in answer.headers["Set-Cookie"] and "HttpOnly" in answer.headers["Set-Cookie"]
        assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]
        assert panel.token not in answer.read().decode()


def test_only_loopback_listens(panel):
    with open("/proc/net/tcp", encoding="ascii") as table:
        listening = [line.split()[1] for line in table if line.split()[3] == "0A"]
    assert [one for one in listening if one.endswith(f":{panel.port:04X}")] == [f"0100007F:{panel.port:04X}"]


def test_a_websocket_of_another_origin_is_refused_and_malformed_messages_leave_the_page_running(panel):
    asyncio.run(_attack(panel))
    assert status(panel.url) == 200


async def _attack(panel):
    url = f"{panel.origin.replace('http', 'ws')}/live"
    for address, headers in (
        (url, {"Origin": panel.origin}),
        (f"{url}?token={panel.token}", {"Origin": "http://evil.example"}),
        (f"{url}?token={panel.token}", {"Host": f"evil.example:{panel.port}"}),
    ):
        with pytest.raises(HTTPClientError, match="403"):
            await websocket_connect(HTTPRequest(address, headers=headers))
    chance = random.Random(1)
    known = ["gear", "set", "profile", "fault", "record", "wish", "own sequence", "steps", "nothing", None, 7]
    values = [
        None,
        True,
        -1,
        1e308,
        "",
        "x" * 5000,
        [],
        [1] * 6,
        {},
        {"a": [[]]},
        "motor.speed",
        "<b>",
        "../../etc/passwd",
        "\ud800",
    ]
    keys = ["name", "value", "gear", "key", "times", "currents", "order", "what", "signals", "number", "length", "content", "id"]
    socket = await websocket_connect(HTTPRequest(f"{url}?token={panel.token}", headers={"Origin": panel.origin}))
    refused = 0

    async def read():
        nonlocal refused
        while (message := await socket.read_message()) is not None:
            refused += isinstance(message, str) and '"ok": false' in message

    reading = asyncio.create_task(read())
    for number in range(MANY):
        if number % 50 == 0:
            await asyncio.sleep(0.01)  # a page that floods the server without reading would be dropped as one that stands still
        kind = chance.randrange(4)
        if kind == 0:
            data: str | bytes = bytes(chance.randrange(256) for _ in range(chance.randrange(40)))
        elif kind == 1:
            data = chance.choice(["", "[" * 3000, "{}", "null", '"x"', '{"do": ', "NaN", "+ "])
        else:
            data = json.dumps({"do": chance.choice(known)} | {chance.choice(keys): chance.choice(values) for _ in range(3)})
        await socket.write_message(data, isinstance(data, bytes))
    await socket.write_message(json.dumps({"id": 12345, "do": "wish", "signals": [], "number": 1, "length": 0.02}))
    for _ in range(600):
        if refused > MANY // 3:
            break
        await asyncio.sleep(0.05)
    assert refused > MANY // 3 and not reading.done(), "each is answered with a sentence"
    socket.close()
    await reading
