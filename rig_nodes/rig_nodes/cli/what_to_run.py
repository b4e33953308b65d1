"""The arguments that ``run`` and ``simulate`` share: which sequence, which rig, where to."""


import argparse


def seed(text: str) -> int:
    """The number of --seed: what fits into 63 bits."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if not 0 <= value < 2**63:
        raise argparse.ArgumentTypeError(f"'{text}': expected a whole number from 0 to 2^63 - 1")
    return value


def add_shared_arguments(parser, by_hand: bool = False) -> None:
    """Sequence and its parameters, output folder, rig, seed, changed values, controller and its level.

    by_hand: it goes without a sequence too.
    """
    text = "name of an installed sequence or a .yaml file"
    if by_hand:
        parser.add_argument("sequence", nargs="?", help=f"{text}; without one the rig runs until Ctrl-C and takes "
                                                        "orders over ROS")
    else:
        parser.add_argument("sequence", help=text)
    parser.add_argument("--out", metavar="DIR", help="folder for the run (default: runs/<sequence>-<n>)")
    parser.add_argument("--rig", metavar="NAME",
                        help="rig or .yaml file (default: the sequence's own, hydmag for most)")
    parser.add_argument("--seed", type=seed, default=1, help="seed of the transducers' noise and errors (default: 1)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="settings",
                        help='change one value of the rig, e.g. alfa46.t12="200 ms" (may be repeated)')
    parser.add_argument("--with", action="append", default=[], metavar="NAME=VALUE", dest="parameters",
                        help='give a parameter of the sequence a value, e.g. speed="1500 rpm" (may be repeated)')
    parser.add_argument("--controller", metavar="SPEC",
                        help="your controller in place of the Alfa46: python:FILE.py:CLASS, "
                             "python:MODULE:CLASS, c:FILE.so or c:FILE.c (docs/controllers.md)")
    parser.add_argument("--level", choices=("duty", "current"),
                        help="what the controller returns, when it knows both (default: its first)")
