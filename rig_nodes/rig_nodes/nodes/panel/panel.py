# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The operator's page between graph and browsers: what the rig does goes to every page, at most FRAMES times a second.

nodes.panel.server makes it and runs it in its loop; nodes.panel.orders does what a page asks for.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Coroutine
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from ...bags import Fields, cdr
from ...base import RigError, printable, unknown
from ...controllers import participants
from ...rig import CONTROLLER, CONTROLLER_COMMAND, CONTROLLER_EVENTS, FAULT_OFF, FAULT_ON, FAULT_ORDERED, OWN
from ..device import own_nodes
from ..running_rig import STATE, STATES, read_in
from .description import Description, described
from .files import own_sequences
from .own_signals import OwnSignals
from .procedures import ProcedureRun, series_of
from .shifts import Shifts
from .tracks import Tracks

if TYPE_CHECKING:
    from ...runs import Procedure, Series
    from .bench import Bench
    from .own_rig import OwnRig
    from .page import Page

FRAMES = 20  # a second
SECOND = FRAMES  # ticks between two looks at what changes slowly
SILENT = 3 * SECOND  # ticks without a message after which the rig counts as away
EVENTS = 200  # that a new page gets
EVENT = "rig_msgs/msg/Event"
FAULTS = FAULT_ORDERED, FAULT_ON, FAULT_OFF  # events after which others are there
LEVELS = ("ok", "warn", "error", "stale")
PATIENCE = 30.0  # s for the answer to an order that takes no time; the page says all the while that it waits


class Panel:
    """What all pages have in common.

    Attributes
    ----------
    pages : set of Page
        The open pages.
    about : Description or None
        The rig; None before one has been found.
    values : dict
        Values of the settings by name [SI].
    procedure : ProcedureRun or None
        The procedure that runs.

    Parameters
    ----------
    bench : Bench
        The graph.
    domain : int
        Its ROS domain.
    own : OwnRig or None
        The rig that the page has started; None for one that it has joined.
    """

    def __init__(self, bench: Bench, domain: int, own: OwnRig | None) -> None:
        self.bench, self.domain, self.own = bench, domain, own
        self.pages: set[Page] = set()
        self.about: Description | None = None
        self.tracks: Tracks | None = None
        self.values: dict[str, Any] = {}
        self._own_signals, self._own_settings = OwnSignals(), list[dict[str, Any]]()
        self.procedure: ProcedureRun | None = None
        self.shifts = Shifts(self.tell)
        self._events: deque[dict[str, Any]] = deque(maxlen=EVENTS)
        why = f"no rig answers in ROS domain {domain} yet" if own is None else "the rig is starting; the first time, it is compiled"
        self._state: dict[str, Any] = {"kind": "state", "state": "away", "reason": why}
        self._health: dict[str, Any] = {}
        self._progress: dict[str, Any] = {"kind": "sequence", "running": False, "text": ""}
        self._found: dict[str, Any] = {}
        self._faults: dict[str, Any] = {"kind": "faults", "on": [], "waiting": []}
        self._faults_due = False  # whether the rig is to be asked for them
        self._known: dict[str, bytes] = {}  # nodes whose values are known or asked for, with the numbers of their publishers
        self._count, self._heard = 0, -SILENT - 1
        self._asked: set[asyncio.Task] = set()
        self._command: Fields | None = None

    def tell(self, message: dict[str, Any]) -> None:
        """Send a message to every page."""
        for page in list(self.pages):
            page.tell(message)

    def greet(self, page: Page) -> None:
        """Tell a new page everything that is known."""
        self.pages.add(page)
        if self.about is not None:
            page.tell(self._rig())
            page.tell({"kind": "values", "values": self._shown(self.values)})
        own = {"kind": "own sequences", "names": own_sequences()}
        known = self._state, self._health, self._progress, self._found, self._faults, own
        for message in (*known, *self._events, *self.shifts.found):
            if message:
                page.tell(message)

    def wish(self) -> None:
        """Decode what some page shows."""
        if self.tracks is not None and self.about is not None:
            shown = {name for page in self.pages if page.wish for name in page.wish.names}
            self.tracks.show(shown | {load.speed for load in self.about.loads.values()})

    # ---- twenty times a second

    def tick(self) -> None:
        """Take what has come and send it on."""
        self._count += 1
        if self.bench.failure is not None:
            raise self.bench.failure
        while self.bench.records:
            self._begin(self.bench.records.popleft())
        taken = self.bench.take()
        if taken:
            self._heard = self._count
        if self.tracks is not None and self.about is not None:
            if self.tracks.add(taken):
                self._restart()
            if self._own_signals.take(taken, self.tracks):
                self.tell({"kind": "own signals", "signals": self._own_signals.described})
                self.wish()
            for topic, known in self.about.config.catalogue.topics.items():
                if known.ros_type == EVENT and topic in taken:
                    self._take_events(topic, taken[topic])
            if STATE in taken:
                self._take_state(taken[STATE][-1], (taken.get(CONTROLLER_COMMAND) or [b""])[-1])
            self.shifts.look(self.tracks, self.about.config.catalogue)
            for page in self.pages:
                page.send_frame(self.tracks)
        self._take_values()
        self._take_progress()
        if self._faults_due:
            self._faults_due = False
            self._spawn(self._ask_faults())
        for page in list(self.pages):
            page.send_texts()
            if page.dropped:
                self.pages.discard(page)
        if self._count % SECOND == 0:
            self._look_slowly()

    def _begin(self, record: dict[str, Any]) -> None:
        """Take the record of a rig that has begun to run, in place of the one before."""
        if self.about is not None:
            self.bench.forget("the rig has ended before it was done")
        try:
            about = Description(record, self.own.rig if self.own else "")
            _ = about.whole  # everything of it that can be refused
        except RigError as error:
            self.tell({"kind": "note", "text": str(error)})
            return
        self.about = about
        catalogue = self.about.config.catalogue
        self.tracks = Tracks(catalogue, STATE)
        self._command = Fields(catalogue.topics[CONTROLLER_COMMAND].ros_type) if self.about.shifts else None
        self.values, self._health, self._known = {}, {}, {}
        self._own_signals, self._own_settings = OwnSignals(), []
        self.bench.health.clear()
        self.bench.listen(*self.about.topics())
        self._restart()
        if self.about.shifts:
            self.shifts.prepare()
        self.tell(self._rig())
        self._ask_anew()

    def _rig(self) -> dict[str, Any]:
        assert self.about is not None
        own = {"own_signals": self._own_signals.described, "own_settings": self._own_settings}
        return {"kind": "rig", "domain": self.domain, "own": self.own is not None, **own} | self.about.whole

    def _spawn(self, work: Coroutine[Any, Any, Any]) -> asyncio.Task:
        task = asyncio.get_running_loop().create_task(work)
        self._asked.add(task)
        task.add_done_callback(self._asked.discard)
        return task

    def _ask_anew(self) -> None:
        """Ask the values of each node that has come, or that was started again and has others than the one before."""
        if self.about is None:
            return
        owners = {one.owner for one in self.about.live.values()} | ({CONTROLLER} if self.about.shifts else set())
        for node, number in self.bench.holders().items():
            if node in owners and self._known.get(node) != number:
                self._known[node] = number
                self._spawn(self._ask_values(node))

    async def _ask_values(self, node: str) -> None:
        known = self._known
        try:
            found = await asyncio.wait_for(asyncio.wrap_future(self.bench.values(node)), PATIENCE)
        except (RigError, TimeoutError):
            known.pop(node, None)  # it is asked again
            return
        own = [described(self.about.setting(name)) for name in found if self.about and name.startswith(f"{CONTROLLER}.{OWN}")]
        if own and own != self._own_settings:
            self._own_settings = own
            self.tell({"kind": "own settings", "settings": own})
            for one in own:
                self.values.pop(one["name"], None)  # told again, to the new fields
        self._learn(found)

    async def _ask_faults(self) -> None:
        """Take from the rig which faults are there: also those that it has begun with, and those that wait."""
        try:
            said = await asyncio.wait_for(asyncio.wrap_future(self.bench.trigger("/rig/faults")), PATIENCE)
        except RigError:
            return  # of a rig that has ended, or of one without faults
        except TimeoutError:
            self._faults_due = True
            return
        there = [one.split(" ") for one in said.split(", ") if one]
        self._faults = {"kind": "faults"} | {key: [name for name, how in there if how == key] for key in ("on", "waiting")}
        self.tell(self._faults)

    def _restart(self) -> None:
        """Time has begun again, of this rig or of another one in its place."""
        self.shifts.forget()
        self._events.clear()
        self._faults = {"kind": "faults", "on": [], "waiting": []}
        self.tell(self._faults)
        self._faults_due = self.about is not None and self.about.config.faults is not None
        for page in self.pages:
            if page.wish:
                page.wish.restart()
        self.wish()
        self.tell({"kind": "restart"})

    # ---- what is told

    def _learn(self, values: dict[str, Any]) -> None:
        values = values | self._torques(self.values | values)
        new = {name: value for name, value in values.items() if value is not None and self.values.get(name) != value}
        self.values |= new
        if new:
            self.tell({"kind": "values", "values": self._shown(new)})

    def _torques(self, values: dict[str, Any]) -> dict[str, float]:
        """Return the torques that the loads' settings make at the present speed."""
        if self.about is None or self.tracks is None:
            return {}
        loads = ((name, load, values.get(load.relief.name)) for name, load in self.about.loads.items())
        return {name: load.torque_of(setting, self.tracks) for name, load, setting in loads if setting is not None}

    def _take_values(self) -> None:
        changed = {}
        while self.bench.changed:
            name, value = self.bench.changed.popleft()
            changed[name] = value
        if self.about is not None and changed:
            owners = {one.owner for one in self.about.live.values()}
            self._learn({name: value for name, value in changed.items() if name.partition(".")[0] in owners})

    def _shown(self, values: dict[str, Any]) -> dict[str, Any]:
        """Return values in the units in which the page shows them; profiles stay SI."""
        assert self.about is not None
        found = {}
        for name, value in values.items():
            if isinstance(value, float):
                with suppress(RigError):
                    found[name] = value * read_in(self.about.setting(name).unit)[1]
            elif isinstance(value, (bool, list)):
                found[name] = value
        return found

    def _take_events(self, topic: str, messages: list[bytes]) -> None:
        assert self.about is not None and self.tracks is not None
        for data in messages:
            try:
                event = cdr.decode(EVENT, data)
            except ValueError:
                continue
            t = event.header.stamp.sec + event.header.stamp.nanosec * 1e-9
            told = {"kind": "event", "t": t, "from": topic.split("/")[1], "name": event.name, "text": event.text}
            self._events.append(told)
            self.tell(told)
            self._faults_due |= event.name in FAULTS
            if self.procedure is not None:
                self.procedure.event(event.name, event.text)
            if topic == CONTROLLER_EVENTS:
                self.shifts.event(event.name, t, self.tracks, self.about.config.catalogue)

    def _take_state(self, data: bytes, command: bytes) -> None:
        try:
            state = cdr.decode("rig_msgs/msg/RigState", data)
            gear = self._command.of(command) if command and self._command else None
        except ValueError:
            return
        told = {
            "kind": "state",
            "state": STATES[state.state].lower(),
            "reason": state.reason,
            "e_stop": bool(state.e_stop),
            "overruns": int(state.overruns),
        }
        if gear is not None:
            told |= {"gear": int(gear["gear"]), "shifting": bool(gear["shifting"])}
        elif "gear" in self._state:
            told |= {"gear": self._state["gear"], "shifting": self._state["shifting"]}
        if told != self._state:
            self._state = told
            self.tell(told)

    def _take_progress(self) -> None:
        told = {"kind": "sequence", **(self.procedure or self.bench).progress}
        if told != self._progress:
            self._progress = told
            self.tell(told)

    def _look_slowly(self) -> None:
        """Once a second: health, nodes, torques of loads at their new speeds, and whether the rig is there."""
        self._learn({})
        self._ask_anew()
        nodes, own = self.bench.nodes(), own_nodes(self.about.config) if self.about else set()
        silent = self._count - self._heard > SILENT
        ended = self.own.how if self.own and self.own.ended else ""
        if ended or (silent and own and own.isdisjoint(nodes)):
            self.bench.forget(ended or "the rig has left its ROS domain")
        start = bool(ended) and self.procedure is None
        if silent and (self._state["state"] != "away" or (ended and ended != self._state["reason"])):
            if self.procedure is not None:
                ended = f"the rig starts anew for procedure '{self.procedure.procedure.name}'"
            why = ended or f"nothing has come from ROS domain {self.domain} for some seconds"
            self._state = {"kind": "state", "state": "away", "reason": why, "start": start}
            self.tell(self._state)
        told = {
            "kind": "health",
            "devices": {
                name: {
                    "level": "stale" if old else LEVELS[min(one.level[0], len(LEVELS) - 1)],
                    "text": f"says nothing any more; the last was: {one.message}" if old else one.message,
                    "values": {value.key: value.value for value in one.values},
                }
                for name, (one, old) in self.bench.said().items()
            },
            "own": self._own_signals.newest.copy(),
            "others": [printable(name) for name in nodes if name not in own],
            "participants": participants(self.domain),
            "pages": len(self.pages),
        }
        if told != self._health:
            self._health = told
            self.tell(told)

    # ---- procedures

    async def series(self, name: str, wanted: str = "") -> tuple[Procedure, list[Series]]:
        """Return a procedure of the rig by its name, with the series that are named; RigError when there is none."""
        if self.about is None:
            raise RigError("no rig answers yet")
        files = self.about.procedures
        if name not in files:
            raise RigError(unknown("procedure", name, files))
        return await asyncio.to_thread(series_of, files[name], self.own.rig if self.own else self.about.config.name, wanted)

    def check_free(self) -> None:
        """RigError while a procedure runs."""
        if self.procedure is not None:
            raise RigError(f"procedure '{self.procedure.procedure.name}' runs; abort it first")

    def start(self, own: OwnRig) -> None:
        """Start the page's own rig again; RigError while it runs."""
        self.check_free()
        own.start()
        self._state = {"kind": "state", "state": "away", "reason": "the rig is starting"}
        self.tell(self._state)

    async def run_procedure(self, procedure: Procedure, chosen: list[Series]) -> str:
        """Run series of a procedure, then start the rig again that is worked by hand; return a sentence on its end.

        It goes on when the page that has ordered it is closed; RigError when it cannot be run here, or did not end as planned.
        """
        if self.own is None:
            raise RigError("this page has joined a rig that somebody else starts; a procedure starts the rig anew for each run")
        run = await asyncio.to_thread(ProcedureRun, self.own, procedure, chosen, self._tell_found)
        self.check_free()
        if self.bench.progress["running"]:
            raise RigError("a sequence runs; abort it first")
        self.procedure = run
        return await asyncio.shield(self._spawn(self._run(run, self.own)))

    async def _run(self, run: ProcedureRun, own: OwnRig) -> str:
        try:
            return await run.run()
        except asyncio.CancelledError:  # the page ends, and the rig with it
            self.procedure = None
            raise
        finally:
            if self.procedure is not None:
                self.procedure = None
                own.start()

    def _tell_found(self, message: dict[str, Any]) -> None:
        self._found = message
        self.tell(message)

    async def close(self) -> None:
        """End what belongs to it."""
        for task in self._asked:
            task.cancel()
        await self.shifts.close()
