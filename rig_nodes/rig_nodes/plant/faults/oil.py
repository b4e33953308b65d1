# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of the oil and its supply: air, cold oil, a worn pump."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .fault import BELOW, FIRST_SPN, Fault, Size

if TYPE_CHECKING:
    from .fault import Target

OIL, SUPPLY = "oil_supply", FIRST_SPN + 64
ATMOSPHERE = 101325.0  # Pa
ADIABATIC = 1.4  # of air
MEAN = 5e5  # Pa, absolute: between an empty and a clamped cylinder (assumed), where the air's stiffness counts


def air(oil: Target, size: float) -> None:
    """Mix air into the oil, a share of its volume at the atmosphere.

    Merritt, Hydraulic Control Systems (1967): 1 / K of a mixture is 1 / K of the oil plus the share of air over 1.4 times its
    pressure; the share at pressure falls with it.
    """
    share = size * ATMOSPHERE / MEAN
    oil["bulk_modulus"] = 1.0 / (1.0 / oil["bulk_modulus"] + share / (ADIABATIC * MEAN))


def cold(oil: Target, size: float) -> None:
    """Make the oil colder by so many kelvins than it would be, and its surroundings too, so that it stays so."""
    oil.shift("oil_temperature", -size)
    oil["ambient_temperature"] -= size


def lacks_temperature(configs: tuple[Any, ...]) -> str:
    """Return what an oil lacks for a fault of its temperature."""
    return "" if configs[0].second_viscosity > 0.0 else "the viscosity of its oil does not depend on temperature"


def worn(oil: Target, size: float) -> None:
    """Add to the fall of the supply's pressure with the flow that is drawn [Pa s/m3]: the gaps of the pump."""
    oil["relief_droop"] += size


FAULTS = (
    Fault(
        *("air", OIL, "oil", "There is air in the oil."),
        *("pressures rise late and softly", air, SUPPLY, BELOW),
        Size("ratio", 0.0, 0.3, 0.05, "share of the volume at the atmosphere"),
    ),
    Fault(
        *("cold", OIL, "oil", "The oil is cold."),
        *("clutches fill slowly and drag more", cold, SUPPLY, BELOW),
        Size("temperature difference", 0.0, 60.0, 25.0, "difference to the oil's temperature"),
        lacks=lacks_temperature,
        effect="oil_temperature",
    ),
    Fault(
        *("worn", OIL, "pump", "The pump is worn."),
        *("supply pressure falls while a clutch fills", worn, SUPPLY, BELOW),
        Size("hydraulic resistance", 0.0, 1e12, 2e10, "further fall of pressure with the flow"),
    ),
)
