# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The `rig` command: it finds the verb, runs its module, and turns errors into one sentence and an exit code.

A verb is a module of this package, or one that another package adds by an entry point, with HELP (a str in one line),
add_arguments(parser) and main(args) -> exit code. Modules are imported only when their verb is called, so that help and
mistakes need no numerics, ROS or viewer. A verb
with PASSES_ON = True gets its arguments unchanged in args.passed_on; one with INTERMIXED = True accepts lists of files
before and behind options. NEEDS = ("ros", "view") names extras without which it does nothing. Where one is missing that the
launcher of a checkout adds when it is asked for, the command becomes the launcher, which adds it and starts the command anew.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import errno
import os
import re
import resource
import signal
import sys
import warnings
from pathlib import Path

from rig_nodes import __version__
from rig_nodes.base import (
    Group,
    Lacking,
    Parser,
    RigError,
    RigWarning,
    Terminated,
    ended_by,
    need_ros,
    not_written,
    optional,
    printable,
)
from rig_nodes.cli.output_files import check_outputs

TYPE_CHECKING = False  # as in typing, whose import would cost time that help does not need
if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Any, TextIO

VERBS = Group("verbs", "verb", __package__, "HELP")
IN_CHECKOUT = (Path(__file__).parents[3] / "rig").is_file()  # where the command is ./rig; elsewhere it is on the path
# errors of any file that is written, whatever the verb: full, over a quota or limit, read-only, broken
OF_THE_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO)
UNFINISHED = "; what was begun is not finished"
NO_MEMORY = f"there is not enough memory for this{UNFINISHED}"
LOADS_NOT = re.compile("failed to map segment|cannot allocate memory", re.IGNORECASE)  # of a library, where memory is short
EXTRAS = {"ros": lambda verb: need_ros(f"rig {verb}"), "view": lambda _: optional("rerun", "view")}


def on_sigterm(_number: int, _frame: object) -> None:
    """Raise Terminated, only once, so that a second signal does not disturb the orderly end."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise Terminated


class NotPrinted(RigError):
    """Output that could not be written, as on a full disk; the reader's end is a BrokenPipeError and no fault."""

    exit_code = 1


class Shown:
    """A stream for people: control characters of printed text are made visible instead of having an effect.

    Ends of lines and tabs stay, and so does a carriage return at either end of a text, which renews a line of progress.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text with its control characters made visible, and return its length."""
        if not IN_CHECKOUT:
            text = text.replace("./rig ", "rig ")
        inner = text.strip("\r")
        before, _, after = text.partition(inner) if inner else (text, "", "")
        with written():
            self._stream.write(before + printable(inner, "\n\t") + after)
        return len(text)

    def flush(self) -> None:
        """Pass on what the stream has kept."""
        with written():
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextlib.contextmanager
def written() -> Iterator[None]:
    """Raise NotPrinted for output that cannot be written."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise NotPrinted(f"its output cannot be written ({error.strerror})") from None


@contextlib.contextmanager
def own_warnings() -> Iterator[None]:
    """Print each warning of the rig as its errors are printed, once; those of other packages stay as they are."""
    said = set()
    with warnings.catch_warnings():
        others = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *place: Any) -> None:
            if not issubclass(category, RigWarning):
                others(message, category, *place)
            elif str(message) not in said:
                said.add(str(message))
                print(f"rig: warning: {printable(message)}", file=sys.stderr)

        warnings.showwarning = show
        yield


def usage() -> str:
    """Return the page that `rig --help` prints."""
    texts = {verb: _help_line(verb) for verb in VERBS.own}
    for verb, point in VERBS.added().items():
        texts.setdefault(verb, f"of the package {point.dist.name}" if point.dist else "of another package")
    width = max(map(len, texts))
    lines = [f"  {verb:<{width}}  {text}" for verb, text in texts.items()]
    return "\n".join(
        ["usage: rig VERB ...", "", "The virtual powertrain test rig.", "", *lines, "", "'rig VERB --help' describes one of them."]
    )


def _help_line(verb: str) -> str:
    """Return the HELP of one of our verbs without importing its module."""
    text = Path(__file__).with_name(f"{verb}.py").read_text(encoding="utf-8")
    return ast.literal_eval(re.search(r"^HELP = (.+)$", text, re.MULTILINE)[1])  # type: ignore[index]


def module_of(verb: str) -> Any:
    """Return the module of a verb.

    Raises
    ------
    RigError
        When the verb does not exist, or the package that adds it is at fault.
    """
    if VERBS.has_own(verb):
        return VERBS.own_module(verb)
    point = VERBS.added().get(verb)
    if point is None:
        from rig_nodes.base import unknown

        raise RigError(unknown("verb", verb, VERBS.names()))
    module = VERBS.load(point)
    lacking = [name for name in ("HELP", "add_arguments", "main") if not hasattr(module, name)]
    if lacking:
        raise VERBS.refused(point, f"has no {', '.join(lacking)}")
    return module


def refuse_empty(verb: str, arguments: list[str]) -> None:
    """Raise RigError for an argument without text: most likely it is an unset shell variable, so no default replaces it."""
    for before, text in zip([f"rig {verb}", *arguments], arguments):
        option, sign, value = text.partition("=") if text.startswith("--") else (before, "=", text)
        if sign and not value.strip():
            raise RigError(f"what follows '{option}' is empty, expected a value; is a shell variable not set?")


def run_verb(verb: str, arguments: list[str]) -> int:
    """Run one verb and return its exit code.

    Raises
    ------
    RigError
        When the verb does not exist or refuses its arguments.
    """
    module = module_of(verb)
    parser = Parser(prog=f"rig {verb}", description=module.HELP, allow_abbrev=False)
    module.add_arguments(parser)
    if getattr(module, "PASSES_ON", False) and arguments[:1] not in (["-h"], ["--help"]):
        check_extras(verb, module)
        return module.main(argparse.Namespace(passed_on=arguments))
    refuse_empty(verb, arguments)
    if "--ros-args" in arguments:
        raise RigError(
            "--ros-args: 'rig' starts its processes itself and passes no ROS arguments to them; the executables of "
            "`ros2 run rig_nodes` and the launch file take it"
        )
    parse = parser.parse_intermixed_args if getattr(module, "INTERMIXED", False) else parser.parse_args
    args = parse(arguments)
    check_outputs(parser, args)
    check_extras(verb, module)
    return module.main(args)


def check_extras(verb: str, module: Any) -> None:
    """Raise Lacking when an extra that a verb needs is not there."""
    for name in getattr(module, "NEEDS", ()):
        EXTRAS[name](verb)


def add_extra(name: str) -> None:
    """Become the launcher, which adds an extra and starts this command once more; return where it cannot."""
    python, _, launcher = os.environ.get("RIG_LAUNCHER", "").partition("\n")
    if launcher and name in os.environ.get("RIG_LATER", "").split():
        _say()
        env = {key: value for key, value in os.environ.items() if key != "LD_LIBRARY_PATH"}
        os.execve(python, [python, launcher, *sys.argv[1:]], dict(env, RIG_WANTS=name))


def main(arguments: list[str] | None = None) -> int:
    """Entry point of the launcher and of the console script; returns the exit code."""
    _open_missing()
    started = arguments is None
    if arguments is None:
        arguments = sys.argv[1:]
        signal.signal(signal.SIGTERM, on_sigterm)
        if arguments and not arguments[0].startswith("-"):
            from rig_nodes.cli.temporary import own_folder

            own_folder()
    with contextlib.redirect_stdout(Shown(sys.stdout)), contextlib.redirect_stderr(Shown(sys.stderr)), own_warnings():
        return _answer(arguments, started)


def _open_missing() -> None:
    """Open /dev/null in place of each standard stream that the caller closed, which Python then has as None.

    No other file may get the number of such a stream, as what is printed would be written to it.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            # it gets the lowest free number, which is that of the stream
            stream = open(os.devnull, mode, encoding="utf-8", errors="backslashreplace")
            os.set_inheritable(stream.fileno(), True)
            setattr(sys, name, stream)


def _answer(arguments: list[str], started: bool) -> int:
    try:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})  # the launcher had blocked it
        if not arguments or arguments[0] in ("-h", "--help", "help"):
            print(usage())
            return 0
        if arguments[0] == "--version":
            print(f"rig {__version__}")
            return 0
        code = run_verb(arguments[0], arguments[1:])
        sys.stdout.flush()
        return code
    except RigError as error:
        if started and isinstance(error, Lacking):
            add_extra(error.extra)
        _say(error)
        return error.exit_code
    except KeyboardInterrupt as stop:
        # for verbs without their own message; a partly printed line of progress stays on the terminal
        what, code = ended_by(stop)
        _say(f"{what}{UNFINISHED}", os.linesep * sys.stderr.isatty())
        return code
    except MemoryError:
        _say(NO_MEMORY)
        return 1
    except ImportError as error:
        if not LOADS_NOT.search(str(error)):
            raise
        _say(NO_MEMORY)
        return 1
    except BrokenPipeError:
        _say()  # the reader (head, less) has ended: this is not an error
        return 141
    except OSError as error:
        sentence, code = _of_system(error)
        _say(sentence)
        return code


def _of_system(error: OSError) -> tuple[str, int]:
    """Return the sentence on an error of the operating system that no verb met itself, and the exit code."""
    if error.errno in OF_THE_DISK:
        return f"{not_written(error.filename or 'what this makes', error)}{UNFINISHED}", 1
    if error.errno in (errno.EMFILE, errno.ENFILE):
        allowed = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
        return f"{allowed} open files are too few for this (ulimit -n){UNFINISHED}", 1
    why = error.strerror or str(error) or type(error).__name__
    return (f"{error.filename}: {why}", 2) if error.filename else (f"{why}{UNFINISHED}", 1)


def _say(sentence: object = "", before: str = "") -> None:
    """Print why the command ends, behind its earlier output; what cannot be written any more goes nowhere.

    Without a sentence it only writes what is still to be printed. ``before`` ends a line that is partly printed.
    """
    sentences = [str(sentence)] * bool(sentence)
    try:
        sys.stdout.flush()  # so that earlier output precedes the error in a log of both streams
    except BrokenPipeError:
        _drop(sys.stdout)
    except NotPrinted as error:
        _drop(sys.stdout)
        sentences.insert(0, str(error))
    try:
        for one in dict.fromkeys(sentences):
            print(f"{before}rig: {printable(one)}", file=sys.stderr)
        sys.stderr.flush()
    except (BrokenPipeError, NotPrinted):  # both may go into one file
        _drop(sys.stderr)


def _drop(stream: TextIO) -> None:
    """Let what a stream has still to write go nowhere, so that Python does not fail with it at its exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
