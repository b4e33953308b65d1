# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files that go between a page and the rig: the controller's settings, a composed sequence, the recording and its report.

nodes.panel.server and nodes.panel.orders use it.
"""

from __future__ import annotations

import asyncio
import re
import shutil
import sys
import tempfile
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base import RigError, atomic_write, brief, not_written, unknown
from ...rig import CONTROLLER, OUTPUT_KEYS, Alfa46Config, read_alfa46
from ...studies import controller_yaml

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from .panel import Panel

NAME = re.compile(r"[\w-][\w.-]{0,59}", re.ASCII)
SEQUENCES = Path("runs", "sequences")  # from the folder in which the page was started
LARGEST_SEQUENCE = 50_000  # letters
COLUMNS = ("times", "currents")


def named(name: Any) -> str:
    """Return a name for a file; RigError when it could be anything else."""
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise RigError(f"the name is {brief(str(name))}; expected letters, digits, '-', '_' and '.', at most 60")
    return name


def controller_text(panel: Panel) -> str:
    """Return the controller's settings as the rig has them now, as a file for `controller:` of a rig; RigError without such."""
    if panel.about is None or not panel.about.shifts:
        raise RigError("the rig that runs has no controller with profiles")
    now, values = panel.about.config.alfa46, panel.values
    scalars = {
        key: value
        for name, value in values.items()
        if name.startswith(f"{CONTROLLER}.") and isinstance(value, float) and hasattr(now.values, key := name.partition(".")[2])
    }
    profiles = now.profiles.copy()
    for k, output in enumerate(OUTPUT_KEYS):
        for column, what in enumerate(COLUMNS):
            profiles[k, :, column] = values.get(f"{CONTROLLER}.{output}.{what}", profiles[k, :, column])
    settings = Alfa46Config(replace(now.values, **scalars), profiles)
    return controller_yaml(settings, "Alfa46, saved from the operator's page", "the operator's page")


def controller_values(panel: Panel, text: str) -> dict[str, Any]:
    """Return what a controller's file sets at the rig that runs, by name [SI]; RigError when it is not right."""
    if panel.about is None or not panel.about.shifts:
        raise RigError("the rig that runs has no controller with profiles")
    with tempfile.TemporaryDirectory(prefix="rig-panel-") as folder:
        path = Path(folder, "controller.yaml")
        path.write_text(text, encoding="utf-8")
        try:
            given = read_alfa46(path)
        except RigError as error:
            raise RigError(str(error).replace(f"{folder}/", "")) from None
    found: dict[str, Any] = {}
    for name, one in panel.about.live.items():
        if one.owner != CONTROLLER:
            continue
        if one.numbers == 1:
            found[name] = float(getattr(given.values, one.key))
        else:
            output, _, column = one.key.partition(".")
            found[name] = np.asarray(given.profiles)[OUTPUT_KEYS.index(output), :, COLUMNS.index(column)].tolist()
    return {name: value for name, value in found.items() if panel.values.get(name) != value}


def own_sequences() -> list[str]:
    """Return the names of the sequences that were composed on the page."""
    return sorted(path.stem for path in SEQUENCES.glob("*.yaml") if NAME.fullmatch(path.stem))


def sequence_file(name: Any) -> Path:
    """Return the file of a composed sequence; RigError when there is none of this name."""
    path = SEQUENCES.absolute() / f"{named(name)}.yaml"
    if not path.is_file():
        raise RigError(unknown("composed sequence", name, own_sequences()))
    return path


def written_sequence(name: Any) -> str:
    """Return the text of a composed sequence; RigError when it cannot be read."""
    path = sequence_file(name)
    try:
        with path.open(encoding="utf-8") as file:
            return file.read(LARGEST_SEQUENCE)
    except (OSError, UnicodeDecodeError) as error:
        raise RigError(f"{path}: cannot be read ({error})") from None


def save_sequence(name: Any, content: Any, replaced: bool = False) -> Path:
    """Write a composed sequence into SEQUENCES.

    Parameters
    ----------
    name, content : Any
        Its name and its text.
    replaced : bool
        Whether it may take the place of another one with this name.

    Returns
    -------
    Path
        Its file.

    Raises
    ------
    RigError
        When it cannot be written, or another one has its name.
    """
    if not isinstance(content, str) or len(content) > LARGEST_SEQUENCE:
        raise RigError(f"a sequence has at most {LARGEST_SEQUENCE} letters")
    path = SEQUENCES.absolute() / f"{named(name)}.yaml"
    if path.is_file() and not replaced and written_sequence(name) != content:
        raise RigError(f"there is another sequence '{name}' already; tick \"replace\", or give this one another name")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise not_written(path.parent, error) from None
    atomic_write(path, content)
    return path


@asynccontextmanager
async def recording(panel: Panel, name: str, report: bool) -> AsyncIterator[Path]:
    """Make a whole bag of what has been recorded up to now, or its report, and give its file until the block ends.

    Parameters
    ----------
    panel : Panel
        The page's rig.
    name : str
        Name of the bag.
    report : bool
        True for the report as an HTML page, False for the bag as a zip archive.

    Raises
    ------
    RigError
        When the page has only joined the rig, or nothing can be read of the recording.
    """
    if panel.own is None:
        raise RigError("this page has joined the rig; its recording is in the folder that `rig run` has printed")
    named(name)
    with tempfile.TemporaryDirectory(prefix="rig-panel-") as folder:
        bag = Path(folder, name)
        await _verb("bag", "recover", str(panel.own.folder), "--out", str(bag))
        if report:
            page = Path(folder, "report.html")
            await _verb("report", str(bag), "--html", str(page))
            yield page
        else:
            yield Path(await asyncio.to_thread(shutil.make_archive, str(bag), "zip", folder, name))


async def _verb(*words: str) -> None:
    """Run a verb of `rig` below the rig's priority; RigError with its last sentence when it has made nothing."""
    process = await asyncio.create_subprocess_exec(
        *("nice", "-n", "10", sys.executable, "-P", "-m", "rig_nodes", *words),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.PIPE,
        start_new_session=True,
    )
    try:
        _, said = await process.communicate()
    except asyncio.CancelledError:
        process.kill()
        raise
    made = Path(words[-1])
    if not made.exists():
        raise RigError((said.decode(errors="replace").strip().splitlines() or ["nothing was made"])[-1].removeprefix("rig: "))
