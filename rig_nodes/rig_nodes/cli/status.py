# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig status``: the present state of the running rig."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .by_hand import add_domain, running_rig
from .shared_arguments import add_json

if TYPE_CHECKING:
    import argparse

    from ..rig import Catalogue, Transmission

HELP = "show what the rig that runs does now"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    add_json(parser, "write it for programs, - for stdout")
    add_domain(parser)


def main(args: argparse.Namespace) -> int:
    """Print the state of the rig; return 0 in every state."""
    from .json_output import write_json

    with running_rig(args) as rig:
        status = rig.status()
        known, box = rig.catalogue, rig.transmission if "gear" in status else None
    if args.json is not None:
        write_json(args.json, status)
    if args.json != "-":
        _tell(status, known, box)
    return 0


def _tell(status: dict, known: Catalogue, box: Transmission | None) -> None:
    """Print the status with the catalogue ``known`` and the transmission ``box``, which is None without a controller."""
    reason = f": {status['reason']}" if status["reason"] else ""
    print(f"rig in ROS domain {status['domain']}: {status['state'].lower()}{reason}, {status['time_s']:.1f} s")
    if "gear" in status:
        gear = box.names[status["gear"]]
        print(f"  controller  gear {gear}{', shifting' if status['shifting'] else ''}")
    for name, signal in status["signals"].items():
        like = known.signal(name)
        print(f"  {name:<10}  {like.shown(signal['value']):>9.4g} {like.display_unit:<5} {like.text}")
    if status["recording"]:
        print(f"  recording   {status['recorded']} messages, {status['lost']} lost")
    else:
        print("  recording   none")
    for name, device in status["devices"].items():
        if device["level"] != "OK" or name == "sequencer":
            print(f"  {name}: {device['message']}")
