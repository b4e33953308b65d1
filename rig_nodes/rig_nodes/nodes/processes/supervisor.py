# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Starts all processes of one run, watches them, ends them in order and reports how the run ended.

`rig run` and the tests use it; the launch file uses the command lines too. It imports no ROS: it communicates with its
children through pipes and signals.
"""

from __future__ import annotations

import contextlib
import math
import os
import selectors
import signal
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from ...base import RigError, not_written, pair
from ...controllers import Domain, environment, participants
from ...rig import PROCESS_LOST, STOOD_STILL
from ...runs import FOLLOWING
from .child import Child
from .tap import tap_pair

MODULES = {"recorder": "recorder", "container": "rig_container", "alfa46": "alfa46", "sequencer": "sequencer"}
END_ORDER = (("container",), ("alfa46", "sequencer"), ("recorder",))
END_TIMEOUT = 12.0  # s that a process has for its orderly end
LOOK = 0.5  # s at most between two looks at the processes
STANDS = 1.0  # s without a sign of a process after which it stands still
FOR_GOOD = 10.0  # s without a sign of it after which a run that cannot go on without it ends
GOES_ON = 2.0  # s in which a process that was continued has gone on, and the rig is in its safe state
LEFT = 2.0  # s that a process has to end once it has closed its line
LONGEST_END = 60.0  # s from a stop signal to the end by force, which leaves the processes to end themselves
AFTER_TRIP = 0.3  # s recorded after the safe state
RESTARTED = ("alfa46", "recorder", "sequencer")  # restarted when they die, in a rig that is operated by hand
LIVES, LIVES_TIME = 3, 60.0  # a process that ends more often than this within so many s is not started again


def processes_of(shifts: bool) -> tuple[str, ...]:
    """Return the processes of a rig, keys of MODULES; ``shifts`` is True when it has a shift controller."""
    return tuple(name for name in MODULES if shifts or name != "alfa46")


@dataclass(frozen=True)
class Order:
    """What to run; with ``sequence`` None the rig runs until it is stopped and takes sequences over ROS.

    ``run`` is the file that says what is run (runs.run_file). Without it, as in a launch file, each process reads rig and sequence
    by their names: ``rig``, ``seed``, ``settings``, ``controller``, ``parameters`` and ``delay`` say so.
    """

    sequence: str | None
    rig: str | None = None
    seed: int = 1
    settings: list[str] = field(default_factory=list)
    drop: str | None = None
    speed: float | None = None  # None: real time, no process waits for another; else lockstep, inf for no pacing
    step_timeout: float | None = 5.0  # s for one sample of the controller in lockstep; None: no limit
    come_timeout: float | None = 60.0  # s in which a controller program of its own has to come, in lockstep; None: no limit
    controller: str | None = None
    parameters: list[str] = field(default_factory=list)  # parameters of the sequence, NAME=VALUE
    processes: tuple[str, ...] = tuple(MODULES)
    delay: int = 1  # samples from a measurement to the effect of the controller's answer
    recording: tuple[str, ...] = ()  # options of the recorder (nodes/processes/recording_options.py)
    run: Path | None = None

    def arguments(self, name: str) -> list[str]:
        """Return the command line of one of the processes, without the options that all processes have."""
        rig = ["--rig", str(self.rig), *(part for text in self.settings for part in ("--set", text))]
        sequence = [] if self.sequence is None else ["--sequence", self.sequence]
        sequence += [part for text in self.parameters for part in ("--with", text)]
        drop = [] if self.drop is None else ["--drop", self.drop]
        speed = [] if self.speed is None else ["--speed", str(self.speed)]
        patience = []
        if self.speed is not None and self.step_timeout is not None:
            patience = ["--step-timeout", str(self.step_timeout)]
        come = []
        if self.speed is not None and self.come_timeout is not None:
            come = ["--come-timeout", str(self.come_timeout)]
        plug = [] if self.controller is None else ["--controller", self.controller]
        numbers = ["--seed", str(self.seed), "--delay", str(self.delay)]
        if self.run is not None:
            rig, sequence, plug, numbers = ["--run", str(self.run)], [], [], []
        return {
            "container": [*rig, *sequence, *drop, *speed, *patience, *numbers],
            "alfa46": [*rig, *plug, *patience, *come],
            "sequencer": [*rig, *sequence],
            "recorder": [*rig, *plug, *self.recording],
        }[name]


@dataclass
class End:
    """How a run ended.

    Parameters
    ----------
    state : str
        "ended", "failed", "tripped" or "interrupted".
    reason : str
        The reason, as a sentence.
    by : int
        The signal that interrupted the run, or 0.
    trip : str
        Name of the trip that ended the run; empty when none did.
    """

    state: str
    reason: str
    by: int = 0
    trip: str = ""

    def plain(self) -> dict[str, str]:
        """Return it as a report and a bag hold it, with the name of a trip only where there is one."""
        return {"state": self.state, "reason": self.reason} | ({"trip": self.trip} if self.trip else {})


END_BY_HAND = End("ended", "ended by hand")


class Supervisor:
    """One run in one folder and one domain.

    A process that dies brings the rig into its safe state. A run of a sequence ends with that; a rig that is operated by
    hand in real time stays up, and the process is started again.

    Parameters
    ----------
    order : Order
        What to run.
    folder : Path
        The run's folder.
    domain : Domain
        The ROS domain.
    say : callable
        Receives (simulated time [s] or None, sentence) for people.
    """

    def __init__(self, order: Order, folder: Path, domain: Domain, say: Callable[[float | None, str], None]) -> None:
        self.order, self.folder, self.domain, self.say = order, Path(folder), domain, say
        self.children: dict[str, Child] = {}
        self.restarts: list[dict] = []  # for each: process, how it ended, simulated time
        self.time = 0.0  # simulated time [s], as reported by the container
        self.state, self.reason, self.trip = "", "", ""  # state of the rig, its reason, and the name of its trip
        self.running = threading.Event()  # set once simulated time passes
        self.ended = threading.Event()
        self.end: End | None = None
        self._others = 0  # DDS participants of other programs that were in the domain before this run
        self._unexplained = ""  # reason of the trip before the controller's plug told more
        self._awaited = ""  # sentence that no controller has come yet, as the alfa46 process reported last
        self._looked, self._watched = time.monotonic(), 0.0  # newest look at the processes, and time of watching them [s]
        self._alive: dict[str, float] = {}  # time of watching when a process last said that it goes on
        self._standing: set[str] = set()  # processes that stand still
        self._unheard = False  # True: what is told can no longer be written
        self._end_at = math.inf
        self._lock = threading.RLock()  # protects the wake pipe; a second signal may interrupt the handler of the first
        self._wake_read, self._wake_write = os.pipe()
        for descriptor in (self._wake_read, self._wake_write):
            os.set_blocking(descriptor, False)

    def stop(self, number: int = 0) -> None:
        """End the run in order, from any thread or signal handler; ``number`` is the signal that asks for it, or 0."""
        names = {signal.SIGINT: "interrupted by Ctrl-C", signal.SIGTERM: "ended by SIGTERM"}
        if self.order.sequence is None and number == signal.SIGINT:
            self._finish_with(END_BY_HAND, 0.0)  # such a run has no other end
        self._finish_with(End("interrupted", names.get(number, "stopped"), number), 0.0)
        with self._lock:
            if not self.ended.is_set():
                with contextlib.suppress(BlockingIOError):
                    os.write(self._wake_write, b".")

    def run(self) -> End:
        """Do everything from the start of the first process to the end of the last, and return how the run ended.

        Signals are handled only in the main thread.
        """
        handled = (signal.SIGINT, signal.SIGTERM) if threading.current_thread() is threading.main_thread() else ()
        before = {number: signal.signal(number, self._on_signal) for number in handled}
        try:
            self._start()
            self._watch()
        finally:
            try:
                end = self._stop_all()
            finally:
                for child in self.children.values():
                    child.close()
                if handled:
                    signal.setitimer(signal.ITIMER_REAL, 0.0)
                for number, handler in before.items():
                    signal.signal(number, handler)
                with self._lock:
                    self.ended.set()
                    os.close(self._wake_read)
                    os.close(self._wake_write)
        return end

    def _on_signal(self, number: int, _frame: object) -> None:
        """End the run in order; whatever this process waits for then, it is over after LONGEST_END."""
        signal.setitimer(signal.ITIMER_REAL, LONGEST_END)  # SIGALRM without a handler ends the process
        self.stop(number)

    def _tell(self, t: float | None, text: str) -> None:
        """Tell people; when that is no longer possible, the run ends in order, because nobody may be there to end it."""
        if self._unheard:
            return
        try:
            self.say(t, text)
        except BrokenPipeError:
            self._unheard = True
            self._finish_with(End("interrupted", "the program that read its output has ended"), 0.0)
        except (OSError, ValueError, RigError) as error:  # a full disk, a closed stream, a character that it cannot have
            self._unheard = True
            self._finish_with(End("failed", f"its output cannot be written ({error})"), 0.0)

    # ---- start and watch

    def _start(self) -> None:
        number = self.domain.number
        self._tell(None, f"starting the nodes in ROS domain {number}: other tools see them with ROS_DOMAIN_ID={number}")
        try:
            (self.folder / "logs").mkdir(exist_ok=True)
        except OSError as error:
            raise not_written(self.folder / "logs", error) from None
        self._others = participants(number)
        links = self._links() if self.order.speed is not None else {}
        for name in self.order.processes:
            self._begin(name, links.get(name))
        for ends in links.values():
            for end in ends.values():
                end.close()

    def _begin(self, name: str, links: dict[str, socket.socket] | None = None, life: int = 1) -> Child:
        """Start one of the processes, for the first time or again."""
        arguments = [*self.order.arguments(name), "--recorded", "--others", str(self._others)]
        if name == "recorder":
            bag = Path(self.order.sequence or self.folder.name).stem
            arguments += ["--out", str(self.folder), "--name", bag, "--piece", str(life - 1)]
        child = Child(
            name, f"rig_nodes.nodes.{MODULES[name]}", arguments, self.folder / "logs", environment(self.domain), links, life
        )
        self.children[name] = child
        self._alive.pop(name, None)  # the one before it is gone
        self._standing.discard(name)
        return child

    def _links(self) -> dict[str, dict[str, socket.socket]]:
        """Return the ends of step handshake and taps, by process and by the name of the process at the other end."""
        links: dict[str, dict[str, socket.socket]] = {name: {} for name in self.order.processes}
        for name in ("alfa46", "sequencer"):
            if name in self.order.processes:
                links["container"][name], links[name]["container"] = pair()
        for name in ("container", "alfa46"):
            if name in self.order.processes:
                links[name]["recorder"], links["recorder"][name] = tap_pair()
        return links

    def _watch(self) -> None:
        """Handle the children's messages until there is a reason to end and its time has come."""
        with selectors.DefaultSelector() as selector:
            selector.register(self._wake_read, selectors.EVENT_READ)
            for child in self.children.values():
                selector.register(child.line, selectors.EVENT_READ, child)
            while time.monotonic() < self._end_at:
                left = max(0.0, min(LOOK, self._end_at - time.monotonic()))
                for key, _ in selector.select(left):
                    child = key.data
                    if child is None:
                        os.read(self._wake_read, 4096)
                        continue
                    for message in child.messages():
                        self._on_message(child, message)
                    if child.silent:
                        selector.unregister(child.line)
                        again = self._on_death(child)
                        if again is not None:
                            selector.register(again.line, selectors.EVENT_READ, again)
                self._look_after_processes()

    def _look_after_processes(self) -> None:
        """Trip a rig in real time one of whose processes stands still, and end a run in which one does so for good.

        Only time in which this process looked counts: after one in which it was stopped itself, or could not write, it has yet to
        read what the others said. A rig that is worked by hand in real time stays in its safe state, unless it is the container
        that stands still.
        """
        now = time.monotonic()
        self._watched += min(now - self._looked, LOOK)
        self._looked = now
        in_real_time = self.order.speed is None
        for name, last in self._alive.items() if self.end is None else ():
            still = self._watched - last
            text = f"the {name} stands still for {still:.1f} s"
            if still > self._longest(name) and (not in_real_time or self.order.sequence is not None or name == "container"):
                self.children["container"].send(trip=text, name=STOOD_STILL)
                self.children[name].signal(signal.SIGCONT)
                self._finish_with(End("failed", text), GOES_ON)
            elif still > STANDS and in_real_time and self.running.is_set() and name not in (*self._standing, "alfa46"):
                self._standing.add(name)
                if name == "container":
                    self._tell(None, f"{text}; the rig neither moves nor answers, and ends after {FOR_GOOD:g} s of that")
                else:
                    self.children["container"].send(trip=text, name=STOOD_STILL)

    def _longest(self, name: str) -> float:
        """Return the time [s] after which a process stands still for good; a controller has its own limits before that."""
        limits = (self.order.step_timeout, self.order.come_timeout) if name == "alfa46" else (0.0,)
        return FOR_GOOD + max(math.inf if limit is None else limit for limit in limits)

    def _on_message(self, child: Child, message: dict) -> None:
        kind = message["kind"]
        if kind == "alive":
            self._alive[child.name] = self._watched
            self._standing.discard(child.name)
        elif kind == "running":
            self.running.set()
            for name in self.children:
                self._alive.setdefault(name, self._watched + FOR_GOOD)  # the first sign may take longer
            self._tell(None, "all nodes are connected, time starts")
        elif kind == "state":
            self._on_state(message)
        elif kind == "step":
            self._tell(message["t"], f"step {message['step']} of {message['steps']}: {message['text']}")
        elif kind == "told":
            self._tell(message.get("t"), message["text"])
        elif kind == "waiting":
            self._awaited = message["awaited"]
            self._tell(None, message["text"])
        elif kind == "end":
            self._finish_with(
                END_BY_HAND if self.order.sequence is None else End("failed", "ended by /rig/end before its sequence was done"), 0.0
            )
        elif kind == "failed":
            self._finish_with(End("failed", self._cause(child, message["text"])), 0.0)
        elif kind == "done" and self.order.sequence is not None:
            if message["success"]:
                self._finish_with(End("ended", "the sequence ended"), 0.0)
            else:
                awaited = f"; {self._awaited}" if self._awaited not in message["text"] else ""  # '' is in every text
                self._finish_with(End("failed", self._explained(message["text"]) + awaited), AFTER_TRIP)

    def _cause(self, child: Child, text: str) -> str:
        """Return why a process failed; where it was the first to notice that another one has ended, how that one did."""
        other = self.children.get(text.removesuffix(" has ended"))
        if other is not None and other.ends_in(LEFT) and other.exit_code:
            return f"{other.name} {other.how()}; see logs/{other.log}"
        return f"{child.name}: {text}"

    def _on_state(self, message: dict) -> None:
        self.time = message["t"]
        if (message["state"], message["reason"]) == (self.state, self.reason):
            return
        if self.reason and self.state == message["state"]:
            self._unexplained = self.reason
        self.state, self.reason, self.trip = message["state"], message["reason"], message["trip"]
        if self.end is not None:
            self.end.reason = self._explained(self.end.reason)
        reason = f": {self.reason}" if self.reason else ""
        self._tell(self.time, f"the rig is {self.state.lower()}{reason}")
        if self.state == "TRIPPED" and self.end is not None and self.end.state == "failed":
            if self.reason not in self.end.reason:
                self.end.reason += f"; safe state: {self.reason}"
            self._end_at = min(self._end_at, time.monotonic() + AFTER_TRIP)
        self._name_trip()

    def _name_trip(self) -> None:
        """Have a run that failed because the rig tripped end as tripped."""
        if self.end is not None and self.end.state == "failed" and self.trip and self.trip not in FOLLOWING:
            self.end.state, self.end.trip = "tripped", self.trip
            if self.reason in self.end.reason:
                self.end.reason = self.reason  # without the step that could not go on

    def _explained(self, text: str) -> str:
        """Return a reason that contains the one of a trip with what the controller's plug told after it in its place."""
        return text.replace(self._unexplained, self.reason) if self._unexplained else text

    def _on_death(self, child: Child) -> Child | None:
        """Bring the rig into its safe state, then end the run or, for a rig operated by hand, start the process again."""
        child.finish(LEFT)
        how = f"{child.name} {child.how()}"
        if child.name != "container" and self.running.is_set() and self.order.speed is None:
            self.children["container"].send(trip=how, name=PROCESS_LOST)
        if not self._may_live_again(child):
            self._finish_with(End("failed", f"{how}; see logs/{child.log}"), AFTER_TRIP)
            return None
        try:
            again = self._begin(child.name, life=child.life + 1)
        except RigError as error:
            self._finish_with(End("failed", f"{how} and cannot be started again: {error}"), AFTER_TRIP)
            return None
        self.restarts.append({"process": child.name, "how": child.how(), "t": self.time, "at": time.monotonic()})
        self._tell(self.time, f"{how} and is started again; see logs/{child.log}")
        child.close()
        self.children["container"].send(event="process_restarted", text=f"{how} and was started again")
        return again

    def _may_live_again(self, child: Child) -> bool:
        if self.order.sequence is not None or self.order.speed is not None or child.name not in RESTARTED:
            return False
        since = time.monotonic() - LIVES_TIME
        lives = 1 + sum(r["process"] == child.name and r["at"] > since for r in self.restarts)
        return self.running.is_set() and self.end is None and lives <= LIVES

    def _finish_with(self, end: End, seconds: float) -> None:
        """End after so many seconds; the first reason stays, and a user's request is served at once."""
        if self.end is None:
            self.end = end
            self._name_trip()
        self._end_at = min(self._end_at, time.monotonic() + seconds)

    # ---- end

    def _stop_all(self) -> End:
        """End the container, then the controllers, then the recorder, so that each receives everything of those before it.

        Returns how the run ended.
        """
        if self.end is None:
            self.end = End("failed", "the supervisor failed")
        for child in self.children.values():
            child.signal(signal.SIGCONT)  # one that was stopped can end in order, and those that wait for it too
        for names in END_ORDER:
            group = [self.children[name] for name in names if name in self.children]
            for child in group:
                if child.name == "recorder":
                    child.send(end=self.end.plain())
                # SIGINT tells the container to leave the rig in its safe state, with a reason in the bag.
                early = child.name == "container" and self.end.state != "ended"
                child.signal(signal.SIGINT if early else signal.SIGTERM)
            for child in group:
                if not child.finish(END_TIMEOUT):
                    self._tell(None, f"{child.name} did not end in {END_TIMEOUT:.0f} s and was killed")
                for message in child.messages():
                    if message["kind"] == "state":
                        self._on_state(message)
                    elif message["kind"] in ("told", "waiting"):
                        self._tell(message.get("t"), message["text"])
                    elif message["kind"] == "failed":
                        self._end_badly(self._cause(child, message["text"]))
                if child.exit_code:
                    self._end_badly(f"{child.name} {child.how()}; see logs/{child.log}")
        return self.end

    def _end_badly(self, reason: str) -> None:
        """Make a run fail that was good so far, because something failed at its end."""
        if self.end.state == "ended":
            self.end = End("failed", reason, self.end.by)
