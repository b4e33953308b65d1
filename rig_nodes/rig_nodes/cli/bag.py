# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig bag`: what bags hold, whether they are whole, their hash, and new bags cut, merged or recovered from them."""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import seconds_of_bag

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..bags import Kept, OpenedBags, RunEnd

HELP = "look into bags, check, recover, cut, merge and hash them"
WHOLE, FAILED, LOST = 0, 1, 3  # exit codes
SHOWN = 10  # faults that are printed


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the verbs below the verb."""
    verbs = parser.add_subparsers(dest="work", required=True, metavar="VERB", parser_class=type(parser))
    for name, text, several in (
        ("info", "print topics, types, counts and times", True),
        ("check", "read everything and count what is lost", True),
        ("hash", "print a hash of topics, times and data that no chunking changes", True),
        ("recover", "write what can be read of a damaged bag into a new one", False),
        ("cut", "write some topics and a span of time into a new bag", False),
        ("merge", "write several bags into a new one, in order of time", True),
    ):
        verb = verbs.add_parser(name, help=text, description=text)
        verb.add_argument("bags", nargs="+" if several else 1, metavar="BAG", help="folder of a bag or one of its files")
        if name in ("recover", "cut", "merge"):
            verb.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the new bag, which is made")
        if name == "cut":
            verb.add_argument(
                "--from", type=seconds_of_bag, dest="begin", metavar="S", help="seconds after the first message (default: 0)"
            )
            verb.add_argument(
                "--to", type=seconds_of_bag, dest="end", metavar="S", help="seconds after the first message, excluded"
            )
            verb.add_argument("--topics", metavar="A,B", help="only these topics")
            verb.add_argument("--regex", type=pattern, metavar="R", help="also topics whose whole name this pattern matches")
            verb.add_argument("--exclude-regex", type=pattern, metavar="R", help="no topics whose whole name this pattern matches")


def main(args: argparse.Namespace) -> int:
    """Do the work; return 0 when all is kept, 3 when some is lost and counted, 1 when it failed."""
    if args.work in ("recover", "cut", "merge"):
        return _tried(_write, args)
    return max([_tried(_look, args.work, path) for path in args.bags], key=(WHOLE, LOST, FAILED).index)


def _tried(work: Callable[..., int], *about: object) -> int:
    """Return the exit code of some work; where it fails the reason is printed, so that the next bag is looked at all the same."""
    from ..base import RigError, printable

    try:
        return work(*about)
    except RigError as error:
        sys.stdout.flush()
        print(f"rig: {printable(error)}", file=sys.stderr)
        return FAILED


def _look(work: str, path: str) -> int:
    from ..bags import OpenedBags, check, content_hash, count

    with OpenedBags([path]) as bags:
        if work == "hash":
            hashes, kept = content_hash(bags)
            print(f"{hashes['all']}  {path}")
            return _print_lost(path, kept)
        kept = check(bags) if work == "check" else count(bags)
        end, cut_off = bags.end()
        if work == "info":
            _info(path, bags, kept, end)
        held = sum(kept.counts.values())
        _print_notes(path, bags)
        if cut_off:
            print(f"rig: {path}: {cut_off}", file=sys.stderr)
        if kept.whole:
            if work == "check":
                print(f"{path}: {'cut off' if cut_off else 'whole'}, {held} messages of {len(kept.counts)} topics")
            return LOST if cut_off else WHOLE
        return _print_lost(path, kept)


def _info(path: str, bags: OpenedBags, kept: Kept, end: RunEnd | None) -> None:
    from ..base import printable

    held, ended = sum(kept.counts.values()), f"; {end.state}: {end.reason}" if end else ""
    span = f"{bags.length / 1e9:.3f} s from {bags.first / 1e9:.3f} s"
    print(printable(f"{path}: {held} messages, {span}, {len(bags.pieces)} files{ended}"))
    types = {topic: ros_type or "-" for topic, ros_type in bags.types.items()}
    width = max(map(len, kept.counts), default=0)
    kind = max(map(len, types.values()), default=0)
    for topic, held in kept.counts.items():
        print(printable(f"  {topic:<{width}}  {types[topic]:<{kind}} {held:>9}"))


def _print_notes(path: str, bags: OpenedBags) -> None:
    """Print what is no fault of the messages: topics that stay bytes, holes in time, renamed files."""
    from ..base import printable

    bytes_only = [f"{name}: {why}; they are kept as bytes" for name in bags.types if (why := bags.not_understood(name))]
    for sentence in [*bags.notes, *bags.holes_in_time, *bytes_only]:
        print(printable(f"rig: {path}: {sentence}"), file=sys.stderr)


def _write(args: argparse.Namespace) -> int:
    from ..bags import OpenedBags, in_short, left_out, limits, write
    from ..base import RigError, printable

    topics, begin, end = None, 0, limits.LAST + 1
    with OpenedBags(args.bags, growing=args.work == "recover") as bags:
        if args.work == "cut":
            topics = chosen(bags.types, args.topics, args.regex, args.exclude_regex)
            begin = bags.time_at(args.begin or 0.0)
            end = end if args.end is None else bags.time_at(args.end)
            if begin >= end or begin > bags.last:
                raise RigError(f"--from and --to: nothing lies between them; the bag is {bags.length / 1e9:.3f} s long")
        if not any(bags.counts.values()):
            why = f" that can be read ({in_short(bags.damage)})" if bags.damage else ""
            raise RigError(f"{bags.path}: holds no messages{why}; there is nothing to write")
        path, kept = write(bags, args.out, topics, begin, end, as_sent=args.work == "recover")
        print(f"{path}: {sum(kept.counts.values())} messages of {len(kept.counts)} topics written")
        if kept.twice:
            print(f"rig: {bags.path}: {kept.twice} messages that were there twice are written once", file=sys.stderr)
        _print_notes(bags.path, bags)
        cut_off = "" if args.work == "cut" else bags.end()[1]
        for sentence in [*left_out(bags), *([cut_off] if cut_off else [])]:
            print(printable(f"rig: {bags.path}: {sentence}"), file=sys.stderr)
    return _print_lost(bags.path, kept) or (LOST if cut_off else WHOLE)


def _print_lost(path: str, kept: Kept) -> int:
    """Print what is lost and return the exit code."""
    if kept.whole:
        return WHOLE
    for sentence in kept.damage[:SHOWN]:
        print(f"rig: {path}: {sentence}", file=sys.stderr)
    if len(kept.damage) > SHOWN:
        print(f"rig: {path}: {len(kept.damage) - SHOWN} more faults", file=sys.stderr)
    for topic, lost in kept.lost.items():
        print(f"rig: {path}: {topic} lost {lost} messages", file=sys.stderr)
    known = sum(kept.lost.values())
    held = sum(kept.counts.values())
    number = f"{known} messages are lost" if known else "none is lost"
    number = "the number of lost messages is not known" if kept.unread and not known else number
    print(f"rig: {path}: damaged, {held} messages are kept, {number}", file=sys.stderr)
    return LOST


def chosen(held: dict[str, str], names: str | None, regex: re.Pattern | None, exclude: re.Pattern | None) -> list[str]:
    """Return the topics that a list of names and two patterns choose; RigError when the bag does not hold one or none is left."""
    from ..base import RigError, unknown

    wanted = [name.strip() for name in (names or "").split(",") if name.strip()]
    if names and not wanted:
        raise RigError("--topics names none; leave it out for all topics")
    for name in wanted:
        if name not in held:
            raise RigError(f"--topics: {unknown('topic in the bag', name, held)}")
    found = [
        topic
        for topic in held
        if (topic in wanted or (regex and regex.fullmatch(topic)) or not (wanted or regex))
        and not (exclude and exclude.fullmatch(topic))
    ]
    if not found:
        raise RigError("the patterns leave no topic of the bag; `rig bag info` lists them")
    return found


def pattern(text: str) -> re.Pattern:
    """Return a compiled pattern for argparse."""
    try:
        return re.compile(text)
    except re.error as error:
        raise argparse.ArgumentTypeError(f"{text} is no regular expression ({error})") from None
