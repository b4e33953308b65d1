"""Draws fig_6_5.png and fig_6_6.png, the clutch models of the thesis's chapter 6, beside itself.

Run `.venv/bin/python docs/pictures/friction_models.py`; it wants matplotlib, which the rig itself does not.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from rig_nodes.plant.friction import closed, drag
from rig_nodes.plant.friction.geometry import PackGeometry
from rig_nodes.rigs.hydmag.laboratory.packs import PACKS

HERE = Path(__file__).parent
RING = PACKS["50x76"]  # the gearbox's plates
# fig. 6.5: one surface; grooves enter only through the effective gap, so the land is the whole ring
VISCOSITY, MIST, GAP, EFFECTIVE_GAP, SHARE = 0.08, 6.53e-4, 0.1e-3, 0.11e-3, 0.5
FILM_RADII = (32e-3, 36e-3)
SLIP = np.linspace(0.0, 200.0, 101)  # rad/s; the thesis's own axis is lost
SURFACES = np.arange(1, 37)
# curves over the number of surfaces: friction of chapter 9.1
STATIC, SPLINE = 0.30, 0.12


def gearbox_ring(surfaces: int) -> PackGeometry:
    """The gearbox's ring and splines with any number of surfaces."""
    return replace(RING.geometry(12), surfaces=float(surfaces))


def drag_curves() -> dict:
    """Torque [Nm] over SLIP of each drag model, by its name in the legend."""
    pack = gearbox_ring(1)
    curves = {"Kitabayashi": drag.kitabayashi(pack, SLIP, VISCOSITY, GAP), "Davis": drag.davis_viscous(pack, SLIP, VISCOSITY, GAP)}
    for radius in FILM_RADII:
        end = f", film to {radius * 1e3:g} mm"
        curves["Pahlovy" + end] = drag.pahlovy(pack, SLIP, VISCOSITY, EFFECTIVE_GAP, radius)
        curves["Peng, Yuan" + end] = drag.peng_yuan(pack, SLIP, VISCOSITY, GAP, radius)
        curves["Iqbal" + end] = drag.iqbal(pack, SLIP, VISCOSITY, GAP, radius, SHARE, MIST)
    return curves


def surface_curves() -> dict:
    """Torque over that of one surface without spline friction, over SURFACES, by name in the legend."""
    one = closed.traditional(gearbox_ring(1), 1.0, STATIC)
    packs = [gearbox_ring(n) for n in SURFACES]
    return {
        "Osinski, k_os n": closed.osinski_factor(SURFACES) * SURFACES,
        "traditional": SURFACES.astype(float),
        "thesis": np.array([closed.thesis(pack, 1.0, STATIC, SPLINE) / one for pack in packs]),
        "Chen": np.array([closed.chen(pack, 1.0, STATIC, SPLINE) / one for pack in packs]),
    }


def draw() -> None:
    """Write both pictures."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(8.0, 5.0), layout="constrained")
    for name, torque in drag_curves().items():
        style = "--" if "36 mm" in name or name == "Davis" else "-"
        axes.plot(SLIP, torque, style, label=name)
    axes.set(
        xlabel="slip [rad/s]",
        ylabel="torque of one surface [Nm]",
        xlim=(0, SLIP[-1]),
        ylim=(0, None),
        title="Drag of one friction surface, parameters of fig. 6.5",
    )
    axes.legend()
    axes.grid(alpha=0.3)
    figure.savefig(HERE / "fig_6_5.png", dpi=110, metadata={"Software": None})

    figure, axes = pyplot.subplots(figsize=(8.0, 5.0), layout="constrained")
    for name, torque in surface_curves().items():
        axes.plot(SURFACES, torque, "o-" if "k_os" in name else "-", markersize=3, label=name)
    axes.axvspan(*closed.OSINSKI_TABLE, alpha=0.1, label="range of Osinski's table")
    axes.set(
        xlabel="friction surfaces n",
        ylabel="torque over that of one loss-free surface",
        xlim=(1, 36),
        ylim=(-2, 20),
        title=f"k_os n (fig. 6.6), and what friction {STATIC:g} with splines {SPLINE:g} gives on 50x76",
    )
    axes.legend()
    axes.grid(alpha=0.3)
    figure.savefig(HERE / "fig_6_6.png", dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    draw()
