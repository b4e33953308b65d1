# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""JSON output of a verb to a place that the user names."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from ..analysis import plain
from ..base import MAKER, atomic_write


def write_json(name: Path | str, content: dict) -> None:
    """Write the content to a file, or to stdout for -; numbers that are not finite become null.

    A file has the maker as its first key, by which a later one may replace it (output_files.py).

    Raises
    ------
    RigError
        When the file cannot be written.
    """
    made_by = {} if name == "-" else {"generator": MAKER}
    text = json.dumps(made_by | plain(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    if name == "-":
        sys.stdout.write(text)
        return
    atomic_write(Path(name), text)
