# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Controllers as FMUs, and what reads an FMU."""
