# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reference controllers: the Alfa46 law as Python class and as C library, as a pattern for users and for tests of the plugs."""
