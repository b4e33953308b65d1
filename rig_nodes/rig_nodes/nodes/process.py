# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What every process of the graph has in common: signals, the connection to its supervisor, executor, orderly end.

rig_container, alfa46, sequencer and recorder use it, under the supervisor of `rig run` and alone.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import resource
import select
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Collection, Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import rclpy
from rclpy.duration import Duration
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from ..bags import LIFE_BITS
from ..base import DEFAULT_RIG, Link, RigError, atomic_write, printable, rig_of
from ..controllers import use_own_transports
from ..rig import load_rig
from ..runs import Ordered, load_sequence, parse_parameters, parse_settings, read_run
from .executor import events_executor
from .processes.line import Line
from .processes.tap import Tap
from .ros_arguments import own_arguments, set_parameters

if TYPE_CHECKING:
    from rclpy.executors import Executor
    from rclpy.node import Node
    from rclpy.publisher import Publisher

ORPHANED = "the process of rig run, which watches the run, has ended"
PATIENCE = 20.0  # s between the order to end and the end by force
ALIVE = 0.05  # s between two signs for the supervisor that this process goes on
STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)
RUN_OPTION = ("--run", {"type": Path, "metavar": "FILE", "help": "run.json of a run, in place of all options that say what is run"})
RIG_OPTIONS = [
    RUN_OPTION,
    (
        "--rig",
        {
            "metavar": "NAME",
            "help": "name or file of the rig's configuration (default: the one that the sequence "
            f"is written for, {DEFAULT_RIG} without a sequence)",
        },
    ),
    (
        "--set",
        {"action": "append", "default": [], "dest": "settings", "metavar": "KEY=VALUE", "help": "change one value of the rig"},
    ),
]
SEQUENCE_PARAMETERS = (
    "--with",
    {
        "action": "append",
        "default": [],
        "dest": "parameters",
        "metavar": "NAME=VALUE",
        "help": "give a parameter of the sequence a value",
    },
)


class Died(RigError):
    """A thread or a callback of the process that ended with an exception which was not caught."""

    exit_code = 1


class Process:
    """One process of the graph, from the first signal handler to the exit code.

    SIGTERM ends it in order. SIGINT does so too, and means that the run is not done (``interrupted``).

    Parameters
    ----------
    name : str
        Name of the process.
    description : str
        Text for its help.
    options : iterable of (str, dict)
        Flags and keywords for argparse, in addition to the common ones.
    """

    def __init__(self, name: str, description: str, options: Iterable[tuple[str, dict]] = ()) -> None:
        """Set up signals, arguments and the connection to the supervisor; the class describes the parameters."""
        self.name, self.stopping, self.interrupted = name, False, False
        self.executor = None
        self.ros_began = 0.0  # time.monotonic() when it joined ROS
        self.failure: RigError | None = None  # what ended one of its threads or callbacks
        threading.excepthook = self._on_thread_death
        self._last_text = ""
        self._began = time.monotonic()
        for number in STOP_SIGNALS:
            signal.signal(number, self._on_signal)
        self.arguments = self._parse(description, options)
        self._act: Callable[[dict], None] = lambda _order: None
        self._line: Line | None = None  # to the supervisor
        self._alive_at = 0.0  # time.monotonic() of the next sign
        self._follow_supervisor()
        # The supervisor starts its children with both blocked, so that none is lost before the handlers stand.
        signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)
        logging.basicConfig(stream=sys.stderr, level=logging.INFO, format=f"{name}: %(message)s")
        self.log = logging.getLogger(name)

    def _parse(self, description: str, options: Iterable[tuple[str, dict]]) -> argparse.Namespace:
        parser = argparse.ArgumentParser(prog=self.name, description=description)
        for flag, keywords in options:
            parser.add_argument(flag, **keywords)
        parser.add_argument("--recorded", action="store_true", help="wait until a recorder listens to every topic")
        parser.add_argument("--logs", type=Path, help="folder for the counts that this process leaves")
        parser.add_argument("--others", type=int, help=argparse.SUPPRESS)
        parser.add_argument("--life", type=int, default=1, help=argparse.SUPPRESS)
        parser.add_argument("--status-fd", type=int, help=argparse.SUPPRESS)
        parser.add_argument("--link", action="append", default=[], dest="links", help=argparse.SUPPRESS)
        return parser.parse_args(own_arguments(sys.argv, self.name)[1:])

    def _follow_supervisor(self) -> None:
        """Receive the supervisor's orders, and end in order when it is gone for any reason; without one there are no orders."""
        if self.arguments.status_fd is None:
            return
        self._line = Line(self.arguments.status_fd)

        def follow() -> None:
            # not sys.stdin: its lock, held by a waiting thread, would break the end of the interpreter
            with open(0, "rb", buffering=0, closefd=False) as orders:
                for line in orders:
                    self._act(json.loads(line))
            os.kill(os.getpid(), signal.SIGTERM)

        threading.Thread(target=follow, name="orders", daemon=True).start()

    def orphaned(self) -> bool:
        """Return whether the supervisor has ended before this process; it is known before any other process can react to that."""
        if self.arguments.status_fd is None:
            return False
        line = select.poll()
        line.register(0, select.POLLHUP)
        return bool(line.poll(0))

    def descriptors(self) -> dict[str, int]:
        """Return the sockets of a run in lockstep by the name of the process at the other end; none in real time."""
        pairs = (text.split(":") for text in self.arguments.links)
        return {other: int(descriptor) for other, descriptor in pairs}

    def links(self) -> dict[str, Link]:
        """Return the links for the step handshake, which connect every process except the recorder."""
        return {
            other: Link(number, other, watchful="alfa46" in (self.name, other))
            for other, number in self.descriptors().items()
            if other != "recorder"
        }

    def tap(self, topics: Iterable[str]) -> Tap | None:
        """Return the way to the recorder beside DDS, for the topics that this process publishes; None in real time."""
        number = self.descriptors().get("recorder")
        return None if number is None else Tap(number, topics)

    def _on_signal(self, number: int, _frame: object) -> None:
        self.interrupted |= number == signal.SIGINT and not self.stopping
        self.stop()

    def _on_thread_death(self, death: threading.ExceptHookArgs) -> None:
        """End the process when a thread dies, because otherwise its work would be missing from then on without an error."""
        thread = death.thread.name if death.thread is not None else "a thread"
        self._fail(f"its thread '{thread}'", death.exc_value)

    def _fail(self, what: str, error: BaseException | None) -> None:
        """End the process in order for an exception that nothing has caught; the first one is its failure."""
        self.failure = self.failure or Died(f"{what} died of {_named(error)}")
        self.stop()
        with suppress(OSError):
            traceback.print_exception(error)

    def stop(self) -> None:
        """Request an orderly end; the process is killed when that takes longer than PATIENCE."""
        if not self.stopping:
            self.stopping = True
            signal.setitimer(signal.ITIMER_REAL, PATIENCE)  # SIGALRM without a handler ends the process

    def status(self, kind: str, **fields: object) -> None:
        """Send one line to the supervisor, without waiting for it to read.

        Without a supervisor, what is new in it goes to the log, for people.

        Parameters
        ----------
        kind : str
            Kind of the line.
        **fields : object
            Its fields, which JSON can hold.
        """
        if self._line is None:
            self._tell(kind, fields)
        else:
            self._line.send(kind, fields)

    def tell(self, text: str, t: float | None = None) -> None:
        """Have a sentence printed for the person at the terminal, at simulated time t [s] when it is given."""
        self.status("told", text=text, **({} if t is None else {"t": t}))

    def _tell(self, kind: str, fields: dict) -> None:
        """Log a status line when its text differs from the one before."""
        text = ""
        if kind == "running":
            text = "all nodes are connected, time starts"
        elif kind in ("done", "told"):
            text = fields["text"]
        elif kind == "state":
            reason = f": {fields['reason']}" if fields["reason"] else ""
            text = f"the rig is {fields['state'].lower()}{reason}"
        if text and text != self._last_text:
            self._last_text = text
            self.log.info("%s%s", f"{fields['t']:.2f} s  " if "t" in fields else "", text)

    @property
    def first_seq(self) -> int:
        """Sequence number of the first messages of this process; it differs from all numbers of an earlier life."""
        return (self.arguments.life - 1) << LIFE_BITS

    def follow_orders(self, act: Callable[[dict], None]) -> None:
        """Call ``act`` with each order of the supervisor from now on, in a separate thread."""
        self._act = act

    def start_ros(self) -> Executor:
        """Initialise rclpy without its signal handlers; return the executor, which is also kept as ``executor``."""
        use_own_transports()
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self.ros_began = time.monotonic()
        self.executor = events_executor()
        return self.executor

    def take_parameters(self, nodes: Collection[Node]) -> None:
        """Set the parameters of these nodes that the command line or a launch file names; RigError when refused."""
        set_parameters(sys.argv, nodes, self.log.warning)

    def spin(self, seconds: float) -> None:
        """Serve callbacks for some seconds; a spin without end would not notice signals.

        An exception of any callback of any node ends the process in order, and the rig container first brings the rig into its
        safe state.
        """
        self._say_alive()
        try:
            self.executor.spin_until_future_complete(Future(), seconds)
        except Exception as error:
            self._fail(f"its callback '{_callback(error)}'", error)

    def wait(self, future: Future, seconds: float) -> None:
        """Serve callbacks until a future is done, for some seconds at most; an exception of a callback is passed on."""
        until = time.monotonic() + seconds
        while not future.done() and time.monotonic() < until:
            self._say_alive()
            self.executor.spin_until_future_complete(future, ALIVE)

    def _say_alive(self) -> None:
        """Tell the supervisor, every ALIVE s at most, that this process goes on."""
        now = time.monotonic()
        if self._line is not None and now >= self._alive_at:
            self._alive_at = now + ALIVE
            self.status("alive")

    def leave(self, nodes: Iterable[Node], publishers: Iterable[Publisher] = (), **facts: object) -> None:
        """End: wait until every subscriber has what was published, write facts and cost, and remove the nodes.

        Parameters
        ----------
        nodes : iterable of Node
            The nodes of the process.
        publishers : iterable of Publisher
            The publishers whose messages must have arrived; the wait ends after 2 s.
        **facts : object
            Facts about the run, which JSON can hold.
        """
        deadline = time.monotonic() + 2.0
        for publisher in publishers:
            left = max(0.0, deadline - time.monotonic())
            publisher.wait_for_all_acked(Duration(seconds=left))
        if self.arguments.logs is not None:
            used = resource.getrusage(resource.RUSAGE_SELF)
            cost = {
                "cpu_s": used.ru_utime + used.ru_stime,
                "wall_s": time.monotonic() - self._began,
                "max_rss_mb": used.ru_maxrss / 1024,
            }
            path = self.arguments.logs / f"{self.name}.json"
            with suppress(RigError):  # the disk is full, and the facts are then unknown
                atomic_write(path, json.dumps({**facts, **cost}, indent=1) + "\n")
        for node in nodes:
            self.executor.remove_node(node)
        # it keeps what it has served alive: DDS would tell the others of this process's end only in an orderly end of Python,
        # which a forked process does not have, and they would wait for its publishers and its acknowledgements
        self.executor.shutdown()
        for node in nodes:
            node.destroy_node()
        rclpy.shutdown()


def ordered(arguments: argparse.Namespace) -> Ordered:
    """Return what is run: what --run holds, or what the other options say; RigError when it is refused.

    The rig is by default that of --sequence. A process without an option has the default of what it says.
    """
    given = vars(arguments)
    if given.get("run"):
        return read_run(arguments.run)
    rig = arguments.rig or rig_of(given.get("sequence"), DEFAULT_RIG)
    config, parameters = load_rig(rig, parse_settings(arguments.settings)), parse_parameters(given.get("parameters", ()))
    sequence = None
    if given.get("sequence"):
        sequence = load_sequence(arguments.sequence, parameters, rig, config=config)
    elif parameters:
        raise RigError("--with gives values to a sequence's parameters; name the sequence with --sequence")
    return Ordered(config, rig, sequence, given.get("seed", 1), given.get("delay", 1), given.get("controller"))


def run(main: Callable[[Callable[..., Process]], object]) -> int:
    """Run a process and return its exit code; a RigError or an unexpected exception becomes one sentence.

    The sentence also goes to the supervisor.

    Parameters
    ----------
    main : callable
        It is called with the function that makes the Process.

    Returns
    -------
    int
        The exit code.
    """
    process = None

    def start(*arguments: Any, **keywords: Any) -> Process:
        nonlocal process
        process = Process(*arguments, **keywords)
        return process

    try:
        main(start)
        if process is not None and process.failure is not None:
            raise process.failure
        return 0
    except Exception as error:
        known = isinstance(error, RigError)
        text = str(error) if known else _named(error)
        if process is not None:
            process.status("failed", text=text)
        with suppress(OSError):  # its log may be on a disk that is full
            print(printable(text), file=sys.stderr) if known else traceback.print_exc()
        return error.exit_code if known else 1


def _callback(error: BaseException) -> str:
    """Return the name of the function of this package in which an exception of a callback began."""
    names = [
        frame.f_code.co_qualname if sys.version_info >= (3, 11) else frame.f_code.co_name
        for frame, _ in traceback.walk_tb(error.__traceback__)
        if "rclpy" not in frame.f_code.co_filename
    ]
    return names[1] if len(names) > 1 else "unknown"  # the first one is Process.spin


def _named(error: BaseException | None) -> str:
    """An unexpected exception as one line."""
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
