# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the search for a shift begins: at the settings in ``tuning.yaml`` of the rig's folder, else at those of its controller.

The verb ``tune`` reads the file; studies.tune.run gives its settings to the scouts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...base import RigError, brief, check_keys, load_yaml, quantity, unknown, where_of, with_bases
from .space import BOUNDS, MA, MS

if TYPE_CHECKING:
    from pathlib import Path

    from ...base import Map
    from ...rig import Transmission

FILE = "tuning.yaml"


def read_beginnings(rig: str | Path, transmission: Transmission) -> dict[str, dict[str, int]]:
    """Read the settings at which the searches begin, from the rig's folder or from the nearest of its bases that has them.

    Parameters
    ----------
    rig : str or Path
        Name of the rig, its folder or its file.
    transmission : Transmission
        The gearbox.

    Returns
    -------
    dict of str to dict of str to int
        By the name of a way the numbers [ms, mA] by the names of space.BOUNDS. A way that is not in it begins at the settings of
        the controller.

    Raises
    ------
    RigError
        With file and line, when the file names another way or setting, or a value outside its bounds.
    """
    files = [path.parent / FILE for path, _ in with_bases(rig)]
    path = next((file for file in files if file.is_file()), None)
    if path is None:
        return {}
    node = load_yaml(path)
    check_keys(path, node, ("begin",), ("begin",), "a tuning", str(path))
    where = where_of(path, node, "begin")
    if not isinstance(node["begin"], dict):
        raise RigError(f"{where}: begin is {brief(node['begin'])}; expected a map from ways to settings")
    ways = transmission.ways()
    for way in node["begin"]:
        if way not in ways and path == files[0]:  # a rig may have other gears than its base
            raise RigError(f"{where_of(path, node['begin'], way)}: {unknown('way', str(way), ways)}")
    return {way: _settings(path, way, one, where_of(path, node["begin"], way)) for way, one in node["begin"].items() if way in ways}


def _settings(path: Path, way: str, node: Map, where: str) -> dict[str, int]:
    check_keys(path, node, BOUNDS, BOUNDS, f"begin of {way}", where)
    out = {}
    for name, (low, high) in BOUNDS.items():
        dimension, unit, symbol = ("current", MA, "mA") if name.endswith("current") else ("time", MS, "ms")
        at = f"{where_of(path, node, name)}: {way} {name}"
        value = quantity(node[name], dimension, at) / unit
        if not (abs(value - round(value)) < 1e-6 and low <= round(value) <= high):
            raise RigError(f"{at} is {brief(str(node[name]))}, expected a whole number of {symbol} from {low} to {high} {symbol}")
        out[name] = round(value)
    return out
