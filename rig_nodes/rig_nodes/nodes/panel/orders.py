# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a page may ask for: each order is one of the graph's own actions, services or parameters, and is answered with a sentence.

nodes.panel.server hands over what came through a websocket, which may be anything.
"""

from __future__ import annotations

import asyncio
import json
import math
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Any

from rosbag2_interfaces.srv import Pause, Resume, SplitBagfile

from ...base import RigError, brief, unknown
from .files import own_sequences, save_sequence, sequence_file, written_sequence
from .panel import PATIENCE
from .tracks import MOST_SIGNALS, Wish

if TYPE_CHECKING:
    from concurrent.futures import Future

    from .page import Page
    from .panel import Panel

LONGEST_SHIFT, LONGEST_SEQUENCE = 30.0, 86_400.0  # s
POINTS = 6  # of a profile
LENGTHS = 1e-3, 1.0  # s of a stretch of a chart
AT_ONCE = 32  # orders of one page that are not answered yet
TOO_MANY = "too many orders at once; wait for the answers"
URGENT = {"e_stop", "reset"}  # which are taken beside so many others
Order = Callable[["Panel", "Page", dict[str, Any]], Awaitable[Any]]


async def answered(future: Future, what: str, seconds: float = PATIENCE) -> Any:
    """Return the result of an order; RigError with ``what`` when nothing comes in time."""
    try:
        return await asyncio.wait_for(asyncio.wrap_future(future), seconds)
    except TimeoutError:
        raise RigError(f"the rig does not answer: no {what} within {seconds:g} s; what was ordered may still be done") from None


def accepted(page: Page, message: dict[str, Any]) -> Callable[[], None]:
    """Return a function for any thread that tells a page that what it has ordered has begun."""
    loop, told = asyncio.get_running_loop(), {"kind": "accepted", "id": message.get("id")}

    def tell() -> None:
        loop.call_soon_threadsafe(page.tell, told)

    return tell


def text(message: dict[str, Any], key: str) -> str:
    """Return a text of a message; RigError when it has none."""
    value = message.get(key)
    if not isinstance(value, str) or not value or len(value) > 4000:
        raise RigError(f"'{key}' is {brief(str(value))}, expected a text")
    return value


def numbers(message: dict[str, Any], key: str, count: int) -> list[float]:
    """Return some finite numbers of a message; RigError when it has not as many."""
    values = message.get(key)
    good = isinstance(values, list) and len(values) == count
    if not good or any(isinstance(v, bool) or not isinstance(v, (int, float)) or not math.isfinite(v) for v in values):
        raise RigError(f"'{key}' is {brief(str(values))}, expected {count} numbers")
    return [float(v) for v in values]


async def gear(panel: Panel, page: Page, message: dict[str, Any]) -> str:
    """Order a gear by its number."""
    number = message.get("gear")
    if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number <= 255:
        raise RigError(f"'gear' is {brief(str(number))}, expected the number of a gear")
    return await answered(panel.bench.shift(number, accepted(page, message)), "end of the shift", LONGEST_SHIFT)


async def set_value(panel: Panel, page: Page, message: dict[str, Any]) -> str:
    """Set a setting as a person writes it, with its unit."""
    if panel.about is None:
        raise RigError("no rig answers yet")
    name, written = text(message, "name"), text(message, "value")
    one = panel.about.setting(name)
    value = one.value_of(written, name)
    if load := panel.about.loads.get(name):
        assert panel.tracks is not None
        one, value = load.relief, load.relief_for(float(value), panel.tracks)
    await answered(panel.bench.set({one.name: value if isinstance(value, bool) else float(value)}), f"answer of {one.owner}")
    return one.sentence(value if isinstance(value, bool) else float(value))


async def profile(panel: Panel, page: Page, message: dict[str, Any]) -> str:
    """Set a whole profile: times [s] and currents [A] of P1 to P6."""
    key = text(message, "key")
    if panel.about is None or f"{key}.times" not in panel.about.live:
        raise RigError(f"there is no output '{brief(key)}' with a profile")
    values = {f"{key}.{column}": numbers(message, column, POINTS) for column in ("times", "currents")}
    await answered(panel.bench.set(values), "answer of the controller")
    return f"profile of {key} set"


async def e_stop(panel: Panel, page: Page, message: dict[str, Any]) -> str:
    """Do the emergency stop."""
    return await answered(panel.bench.trigger("/rig/e_stop"), "answer of /rig/e_stop")


async def reset(panel: Panel, page: Page, message: dict[str, Any]) -> str:
    """Leave the safe state."""
    return await answered(panel.bench.trigger("/rig/reset"), "answer of /rig/reset")


async def sequence(panel: Panel, page: Page, message: dict[str, Any]) -> str:
    """Run a sequence by its name, to its end."""
    run = panel.bench.run_sequence(text(message, "name"), accepted(page, message))
    return await answered(run, "end of the sequence", LONGEST_SEQUENCE)


async def own_sequence(panel: Panel, page: Page, message: dict[str, Any]) -> str:
    """Run a composed sequence to its end; one whose steps are given is saved first."""
    saved, name = message.get("content") is not None, message.get("name")
    path = save_sequence(name, message["content"], message.get("replace") is True) if saved else sequence_file(name)
    panel.tell({"kind": "own sequences", "names": own_sequences()})
    done = await answered(panel.bench.run_sequence(str(path), accepted(page, message)), "end of the sequence", LONGEST_SEQUENCE)
    return f"{done}; it is saved as {path}" if saved else done


async def steps(panel: Panel, page: Page, message: dict[str, Any]) -> str:
    """Return the text of a composed sequence."""
    return written_sequence(message.get("name"))


async def series(panel: Panel, page: Page, message: dict[str, Any]) -> str:
    """Say which series a procedure has."""
    procedure, found = await panel.series(text(message, "name"))
    runs = "run" if procedure.repeats == 1 else "runs"
    return f"{len(found)} series of {procedure.repeats} {runs}: {', '.join(one.label for one in found)}"


async def procedure(panel: Panel, page: Page, message: dict[str, Any]) -> str:
    """Run a procedure, or those of its series that are named, to its end."""
    chosen = await panel.series(text(message, "name"), str(message.get("series") or ""))
    accepted(page, message)()
    return await panel.run_procedure(*chosen)


async def abort(panel: Panel, page: Page, message: dict[str, Any]) -> str:
    """Abort the procedure or the sequence that runs."""
    if panel.procedure is not None:
        return panel.procedure.abort()
    return await answered(panel.bench.cancel_sequence(), "answer of the sequencer")


async def fault(panel: Panel, page: Page, message: dict[str, Any]) -> str:
    """Order a fault or its end, as `--fault` takes it."""
    order = text(message, "order")
    await answered(panel.bench.set({"rig.fault": order}), "answer of the rig")
    return f"fault ordered: {order}"


async def record(panel: Panel, page: Page, message: dict[str, Any]) -> str:
    """Pause the recorder, let it go on, or begin a new file of the bag."""
    kinds = {
        "pause": (Pause, "the recording is paused"),
        "resume": (Resume, "the recording goes on"),
        "split_bagfile": (SplitBagfile, "a new file of the bag has begun"),
    }
    what = text(message, "what")
    if what not in kinds:
        raise RigError(unknown("order of the recorder", what, kinds))
    kind, done = kinds[what]
    await answered(panel.bench.call(kind, f"/recorder/{what}", kind.Request(), lambda _: None), "answer of the recorder")
    return done


async def start(panel: Panel, page: Page, message: dict[str, Any]) -> str:
    """Start the page's own rig again after its end."""
    if panel.own is None:
        raise RigError("this page has joined a rig that somebody else starts")
    panel.start(panel.own)
    return "the rig is starting"


async def wish(panel: Panel, page: Page, message: dict[str, Any]) -> str:
    """Take what the page's charts show: signals by name, and the length of a stretch of time [s]."""
    names, number = message.get("signals"), message.get("number")
    (length,) = numbers({"length": [message.get("length")]}, "length", 1)
    if not isinstance(names, list) or len(names) > MOST_SIGNALS or not all(isinstance(one, str) for one in names):
        raise RigError(f"'signals' is {brief(str(names))}, expected at most {MOST_SIGNALS} names of signals")
    if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < 2**32:
        raise RigError("'number' must be a whole number from 0 to 2^32 - 1")
    if not LENGTHS[0] <= length <= LENGTHS[1]:
        raise RigError(f"'length' is {length:g} s, expected {LENGTHS[0]:g} to {LENGTHS[1]:g} s")
    page.wish = Wish(number, names, length)
    panel.wish()
    return ""


ORDERS: dict[str, Order] = {
    "gear": gear,
    "set": set_value,
    "profile": profile,
    "e_stop": e_stop,
    "reset": reset,
    "sequence": sequence,
    "own sequence": own_sequence,
    "steps": steps,
    "series": series,
    "procedure": procedure,
    "abort": abort,
    "fault": fault,
    "record": record,
    "start": start,
    "wish": wish,
}


async def obey(panel: Panel, page: Page, data: str | bytes, waiting: int) -> None:
    """Do what a page asks for, ``waiting`` of whose orders wait, and answer it; what cannot be read is answered with a refusal."""
    number = None
    try:
        try:
            message = json.loads(data)
            json.dumps(message, ensure_ascii=False).encode()  # ROS takes no lone surrogate
        except (ValueError, RecursionError):
            raise RigError("a message to the rig's page must be JSON, its texts Unicode") from None
        if not isinstance(message, dict):
            raise RigError("a message to the rig's page must be a JSON object")
        number = message.get("id") if isinstance(message.get("id"), int) else None
        order = ORDERS.get(str(message.get("do")))
        if order is None:
            raise RigError(unknown("order", str(message.get("do")), ORDERS))
        if waiting >= AT_ONCE and message["do"] not in URGENT:
            raise RigError(TOO_MANY)
        answer, done = await order(panel, page, message), True
    except RigError as error:
        answer, done = str(error), False
    if number is not None or not done:
        page.tell({"kind": "answer", "id": number, "ok": done, "text": answer})
