# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig replay BAG`: it publishes a recorded bag again over real ROS 2, in order, with /clock."""

from __future__ import annotations

import argparse
import math
import os
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import number_within, seconds_of_bag
from .bag import chosen, pattern

if TYPE_CHECKING:
    from ..bags import OpenedBags, Player
    from ..nodes import Outcome

HELP = "publish a recorded bag again, with /clock"
NEEDS = ("ros",)
LOST = 3  # exit code: replayed, but not everything that was recorded
KEYS = "space: pause and go on, right arrow: next message, up and down: rate 10 % higher or lower, q: end"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("bags", nargs="+", metavar="BAG", help="folder of a run or of another bag, or a file; several are one bag")
    parser.add_argument(
        "--rate", type=_rate, default=1.0, metavar="R", help="recorded seconds per second, 0.01 to 100, or 'max' (default: 1)"
    )
    parser.add_argument(
        "--start",
        type=seconds_of_bag,
        default=0.0,
        metavar="S",
        help="seconds after the beginning of the bag to start at (default: 0)",
    )
    parser.add_argument("--duration", type=seconds_of_bag, metavar="S", help="recorded seconds to replay (default: up to the end)")
    parser.add_argument("--until", type=seconds_of_bag, metavar="S", help="seconds after the beginning of the bag to end before")
    parser.add_argument("--delay", type=seconds_of_bag, default=0.0, metavar="S", help="seconds to wait before the first message")
    parser.add_argument("--loop", action="store_true", help="begin again at the end, until stopped")
    parser.add_argument("--paused", action="store_true", help="start paused")
    parser.add_argument("--topics", type=_names, metavar="A,B", help="only these topics")
    parser.add_argument("--regex", type=pattern, metavar="R", help="also topics whose whole name this pattern matches, no others")
    parser.add_argument("--exclude-regex", type=pattern, metavar="R", help="no topics whose whole name this pattern matches")
    parser.add_argument(
        "--remap", type=_pair, action="append", default=[], metavar="A:=B", help="publish topic A as B; may be given several times"
    )
    parser.add_argument(
        "--clock",
        type=_frequency,
        default=200.0,
        metavar="HZ",
        help="/clock messages per recorded second, 1 to 10000 (default: 200)",
    )
    parser.add_argument(
        "--qos",
        type=Path,
        metavar="FILE",
        help="YAML file with other qualities of service of topics, as of ros2 bag play --qos-profile-overrides-path",
    )
    parser.add_argument("--no-keys", action="store_true", help="take no keys from the terminal")
    parser.add_argument(
        "--wait", type=_count, default=0, metavar="N", help="wait until N subscriptions of the bag's topics are connected"
    )


def node() -> int:
    """Run ``ros2 run rig_nodes replay`` in the domain of its terminal, as other nodes do."""
    from ..base import RigError
    from ..nodes import own_arguments
    from .main import main as rig

    os.environ["ROS_DOMAIN_ID"] = os.environ.get("ROS_DOMAIN_ID") or "0"
    try:
        own = own_arguments(sys.argv, "rig_replay")
    except RigError as error:
        print(f"rig: {error}", file=sys.stderr)
        return error.exit_code
    return rig(["replay", *own[1:]])


def main(args: argparse.Namespace) -> int:
    """Check, replay and print what was sent; return 0 at the end and after q, 3 when something is lost, 130 after Ctrl-C."""
    from ..bags import OpenedBags

    with OpenedBags(args.bags) as bag:
        return _replay(bag, args)


def _replay(bag: OpenedBags, args: argparse.Namespace) -> int:
    from ..bags import HOLE, Played, Player, offered_by
    from ..base import RigError, unknown
    from ..controllers import environment, from_environment
    from .keyboard import Keyboard

    begin, end, topics = _chosen(bag, args)
    names = dict(args.remap)
    for topic in names:
        if topic not in bag.types:
            raise RigError(f"--remap: {unknown('topic in the bag', topic, bag.types)}")
    for sentence in bag.damage:
        _warn_damage(bag, sentence)
    for sentence in (*bag.notes, *bag.holes_in_time):
        _warn(f"{bag.path}: {sentence}")
    bag.on_damage = lambda sentence: _warn_damage(bag, sentence)
    with from_environment() as domain:
        domain.lead()
        wanted = environment(domain)
        for name in set(os.environ) - set(wanted):
            del os.environ[name]
        os.environ.update(wanted)
        # ROS reads the environment above when it is loaded or started.
        from ..nodes import CLOCK_TOPIC, ReplaySession, latched, obstacle, offered, read_overrides

        profiles = {} if args.qos is None else read_overrides(args.qos)
        if others := [topic for topic in profiles if topic not in bag.types]:
            _warn(f"{args.qos}: names topics that are not in the bag: {', '.join(others)}")
        sound, lost = [], False
        for topic in topics:
            if why := obstacle(bag, topic):
                _warn(f"{topic}: {bag.counts[topic]} messages are left out: {why}")
                lost |= bag.counts[topic] > 0 and topic != CLOCK_TOPIC  # the replay's own clock stands for the recorded one
            else:
                sound.append(topic)
                if problem := offered_by(bag.channel(topic)[2].get("offered_qos_profiles", "")).problem:
                    _warn(f"{topic}: its recorded quality of service cannot be read ({problem}); the default is offered")
        lasting = {topic for topic in sound if latched(offered(bag, topic, profiles.get(topic)))}
        if next(bag.timeline(lasting, end=begin), None) is None and next(bag.timeline(sound, begin, end), None) is None:
            raise RigError(f"{bag.path}: nothing is left to replay after {args.start:g} s on these topics")
        player = Player(
            Played(
                lambda first, last: bag.timeline(sound, first, last), begin, end, lambda at: list(bag.timeline(lasting, end=at))
            ),
            rate=args.rate,
            loop=args.loop,
            paused=args.paused,
            period=round(1e9 / args.clock),
            hole=HOLE,
        )
        print(
            f"replaying {sum(bag.counts[topic] for topic in sound)} messages of {len(sound)} topics in ROS domain "
            f"{domain.number}: ROS_DOMAIN_ID={domain.number} lets other tools receive them",
            flush=True,
        )
        with Keyboard(not args.no_keys) as keys:
            if keys.there:
                print(KEYS, flush=True)
            session = ReplaySession(lambda text: print(text, flush=True), keys, names, args.delay, profiles)
            outcome = session.run(bag, sound, player, args.wait)
    _tell(outcome, player)
    if outcome.ended_by:
        return 128 + outcome.ended_by
    return LOST if bag.damage or lost or outcome.given_up else 0


def _chosen(bag: OpenedBags, args: argparse.Namespace) -> tuple[int, int, list[str]]:
    """Return begin and end [ns] of the replay and its topics; RigError when the bag does not have them."""
    from ..base import RigError

    if not any(bag.counts.values()):
        why = f" ({'; '.join(bag.damage)})" if bag.damage else ""
        raise RigError(f"{bag.path}: holds no messages{why}; there is nothing to replay")
    length = bag.length / 1e9
    if args.start > length:
        raise RigError(f"--start {args.start:g}: the bag is {length:.3f} s long; give a time within it")
    topics = chosen(bag.types, ",".join(args.topics or ()), args.regex, args.exclude_regex)
    begin, end = bag.time_at(args.start), bag.last + 1
    if args.duration is not None:
        if not args.duration > 0.0:
            raise RigError(f"--duration {args.duration:g}: give a time above 0 s")
        end = min(end, bag.time_at(args.start + args.duration))
    if args.until is not None:
        if args.until <= args.start:
            raise RigError(f"--until {args.until:g}: the replay begins at {args.start:g} s; give a later time")
        end = min(end, bag.time_at(args.until))
    return begin, end, topics


def _tell(outcome: Outcome, player: Player) -> None:
    sent = sum(outcome.counts.values())
    width = max(map(len, outcome.counts))
    for topic, count in outcome.counts.items():
        print(f"  {topic:<{width}} {count:>8}")
    lateness = ", ".join(f"{name} {1e3 * outcome.late(share):.1f}" for name, share in (("p50", 0.5), ("p99", 0.99), ("max", 1.0)))
    print(
        f"{sent} messages in {outcome.seconds:.2f} s, {player.passes} "
        f"{'pass' if player.passes == 1 else 'passes'}; lateness in ms: {lateness}"
    )
    if player.behind:
        print(f"stalls put the replay back by {player.behind:.2f} s in all")


def _warn_damage(bag: OpenedBags, sentence: str) -> None:
    _warn(f"{bag.path} is damaged, only what is whole of it is replayed: {sentence}")


def _warn(text: str) -> None:
    print(f"rig: {text}", file=sys.stderr, flush=True)


def _rate(text: str) -> float:
    return math.inf if text == "max" else number_within(text, "rate; give 0.01 to 100, or max", 0.01, 100.0)


def _frequency(text: str) -> float:
    return number_within(text, "frequency of the clock; give 1 to 10000 messages per recorded second", 1.0, 1e4)


def _count(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text} is no number of subscriptions; give 0 or more")
    return int(text)


def _pair(text: str) -> tuple[str, str]:
    before, sign, after = text.partition(":=")
    if not sign or not before or not re.fullmatch(r"(/[A-Za-z_]\w*)+", after):
        raise argparse.ArgumentTypeError(f"{text} is no pair of topics; give old and new name, e.g. /motor/state:=/recorded/motor")
    return before, after


def _names(text: str) -> list[str]:
    names = list(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    if not names:
        raise argparse.ArgumentTypeError("there is no topic; give names as in the bag, e.g. /motor/state")
    return names
