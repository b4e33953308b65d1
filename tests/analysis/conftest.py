# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lets the tests of this folder import the shifts made by hand."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
