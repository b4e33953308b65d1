# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The benchmark of fault detectors: a public set of runs by seed, a detector as baseline, and scores."""
