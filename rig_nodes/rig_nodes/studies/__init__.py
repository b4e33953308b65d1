# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many runs: sweeps, tuning, calibration, validation, benchmarks."""
