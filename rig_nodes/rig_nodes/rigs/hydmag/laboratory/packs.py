# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The packs of plates that the thesis tested on its clutch bench (chapter 8)."""

from __future__ import annotations

from dataclasses import dataclass

from rig_nodes.plant import PackGeometry


@dataclass(frozen=True)
class BenchPack:
    """One size of plates on the bench. Lengths in m; ``surfaces`` are the numbers of friction surfaces that were tested."""

    name: str
    inner_diameter: float
    outer_diameter: float
    inner_spline_diameter: float
    outer_spline_diameter: float
    plate_thickness: tuple[float, ...]
    surfaces: tuple[int, ...]
    material: str
    source: str

    def geometry(self, surfaces: int) -> PackGeometry:
        """Return the pack with a number of friction surfaces; raise ValueError when it was not on the bench."""
        if surfaces not in self.surfaces:
            known = ", ".join(map(str, self.surfaces))
            raise ValueError(f"{self.name} was tested with {known} surfaces, not {surfaces}")
        return PackGeometry(
            float(surfaces),
            self.inner_diameter / 2.0,
            self.outer_diameter / 2.0,
            self.inner_spline_diameter,
            self.outer_spline_diameter,
            30.0,
        )


ALL = (18, 16, 14, 12, 10)
STEEL = ((33e-3, 135e-3), "steel S355J2 on steel S355J2")  # DIN 5480 N 36x1.5x22 and W 140x3x45, tab. 8.3
LINED = ((42e-3, 80e-3), "organic JP402 on steel")  # the gearbox's plates, tab. 3.3, in adapters (fig. 8.3)


def _pack(
    name: str,
    inner: float,
    outer: float,
    thickness: tuple[float, ...],
    surfaces: tuple[int, ...],
    plates: tuple[tuple[float, float], str],
    source: str,
) -> BenchPack:
    splines, material = plates
    return BenchPack(name, inner, outer, *splines, thickness, surfaces, material, source)


PACKS = {
    pack.name: pack
    for pack in (
        _pack("80x115", 80e-3, 115e-3, (1e-3, 1.5e-3, 2e-3), ALL, STEEL, "tab. 8.1-8.3, 8.3.1"),
        _pack("80x101.9", 80e-3, 101.9e-3, (2e-3,), ALL, STEEL, "tab. 8.1-8.3, 8.3.2"),
        _pack("65x115", 65e-3, 115e-3, (2e-3,), ALL, STEEL, "tab. 8.1-8.3, 8.3.3"),
        _pack("46x88.9", 46e-3, 88.9e-3, (2.5e-3,), (18, 16), STEEL, "tab. 8.1-8.3, 8.3.4; 16 surfaces seized"),
        _pack("50x76", 50e-3, 76e-3, (1e-3, 3e-3), ALL, LINED, "tab. 3.3, 8.3.5"),
    )
}
