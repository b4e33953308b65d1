# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The provenance in an exported file: the settings and the rig of its run, and the events.

bags.exchange.files writes it into each format; bags.exchange.foreign reads it, so that an exported run can be imported without a
profile.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING

from ... import __version__
from .. import limits

if TYPE_CHECKING:
    from ..reader import Bag

KEY = "rig_nodes.run"  # key in the metadata of Parquet, and name of the attachment or variable in the other formats
CSV_DIGEST = "rig:csv_sha256"  # key beside a CSV file: the digest of the content that is described there


def provenance_of(small: Bag) -> dict:
    """Return the provenance of an exported run.

    Parameters
    ----------
    small : Bag
        Events and description of the run.

    Returns
    -------
    dict
        ``run`` is the record of the run with its configuration, seed, versions and, of a re-run, its parent; ``events`` are rows
        (t [s], topic, name, text, value); ``bag`` and ``sha256`` name the bag's file; ``exported_by`` is this version.
    """
    path = small.path if small.path.is_file() else next(iter(sorted(small.path.glob("*.mcap"))))
    return {
        "run": {**small.run_info(), "configuration": dict(small.record)},
        "events": [list(event) for event in small.events()],
        "bag": path.name,
        "sha256": digest_of(path),
        "exported_by": f"rig_nodes {__version__}",
    }


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def text_of(provenance: dict) -> str:
    """Return the provenance as JSON."""
    return json.dumps(provenance, ensure_ascii=False)


def read_provenance(text: object) -> dict | None:
    """Return the provenance from JSON; None for JSON that is not the provenance of an exported run."""
    if not isinstance(text, (str, bytes)) or len(text) > limits.JSON:
        return None
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(found, dict) or limits.deeper(found, limits.JSON_DEPTH):
        return None
    run, events = found.get("run"), found.get("events")
    whole = isinstance(run, dict) and isinstance(run.get("configuration"), dict) and isinstance(events, list)
    return found if whole and all(isinstance(event, list) and len(event) == 5 for event in events) else None


def lines_of(provenance: dict) -> list[tuple[str, str]]:
    """Return names and values of the main facts of the provenance."""
    run = provenance["run"]
    facts = [("rig", run["configuration"].get("name")), ("sequence", run.get("sequence")), ("seed", run.get("seed"))]
    parent = run.get("parent")
    facts += [("parent", parent.get("bag") if isinstance(parent, dict) else None), ("bag", provenance["bag"])]
    versions = run.get("versions")
    facts += [
        ("simulated_by", f"rig_nodes {versions['rig_nodes']}" if isinstance(versions, dict) and "rig_nodes" in versions else None)
    ]
    return [(name, str(value)) for name, value in [*facts, ("exported_by", provenance["exported_by"])] if value is not None]


def csvw_path(path: Path) -> Path:
    """Return the path at which "CSV on the Web" expects the description of a CSV file."""
    return path.with_name(f"{path.name}-metadata.json")
