# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What Annex D's printed pressures require of the drains and of S2's oil, and the torque that they allow in a downshift.

Used by `rig calculate` and tests/rigs/test_annex_d.py. Nothing is run: the curves are those of targets.yaml.
"""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.plant import thesis
from rig_nodes.rigs.hydmag.laboratory.calibration_rows import SUPPLY, calibrating, on_curve
from rig_nodes.runs import Table, load_procedure

if TYPE_CHECKING:
    from rig_nodes.rig import RigConfig

KINETIC = 0.17  # 9.1: friction of slipping plates in the thesis's simulation
END = 2.3  # MPa, Annex D: end value of both pressures
FILL, LAST = 0, 2  # pieces of p2's rise: its first one, and the cubic that ends at the level
PLATEAU, RAMP = "alfa46.output_2.P2", "alfa46.output_2.P3"  # settings of ZR-P2's series: ends of the plateau and of the ramp
INSTANTS = (0.1, 0.15, 0.2, 0.26, 0.3, 0.35, 0.407)  # s: 0.26 is the longest t_dtr (7.5), and p1 reaches its level at 0.407


def drains(config: RigConfig) -> Table:
    """Bore of the drain by the fall of p1 and by the return of S2's piston, both by the orifice law.

    The fill of S2 gives the flow Q of the supply's bore, A_p^2 / c dp/dt with springs of rate c. In p2's last rise that bore
    delivers the volume that the closed pack and its line take up: the integral of Q sqrt((p_P - p) / (p_P - p_fill)). A bore A that
    empties a volume C p makes sqrt(p) a line of the slope A sqrt(2 / rho) / (2 C), so that p is a perfect square over time, as
    Annex D prints p1's fall. While the springs return the piston, C is A_p^2 / c.

    Parameters
    ----------
    config : RigConfig
        The rig.

    Returns
    -------
    Table
        Volume that moves, its time, and the bore (times its discharge coefficient).
    """
    rows, clutch, speed = calibrating(), config.clutch_s2, sqrt(2.0 / config.oil_supply.density)
    rise, fall, back = (rows[name].pieces for name in ("ch9_pressure_up_p2", "ch9_pressure_up_p1", "ch9_pressure_down_p2"))
    springs = clutch.piston_area**2 / clutch.spring_rate
    (_, filled, (slope, _)), (began, ended, cubic) = rise[FILL], rise[LAST]
    t = np.linspace(began, ended, 1000)
    p = 1e6 * np.minimum(np.polyval(cubic, t), END)
    flow = springs * 1e6 * slope * np.sqrt((SUPPLY - p) / (SUPPLY - 0.5e6 * slope * filled))
    elastic = float(np.trapezoid(flow, t)) / (p[-1] - p[0])
    (_, level, (square, _, _)), (start, end, _) = fall[0], back[1]
    high, low = (float(one) for one in on_curve(rows["ch9_pressure_down_p2"], np.array([start + 1e-6, end])))
    bore = 2.0 * springs * (sqrt(high) - sqrt(low)) / (speed * (end - start))
    return Table(
        "Bore of the drain, times its discharge coefficient, that each falling pressure of Annex D requires.",
        {"curve": "", "volume": "cm3", "time": "ms", "bore": "mm2"},
        [
            ("p1 falls from 2.3 MPa to 0", elastic * END * 1e6, level, 2.0 * elastic * sqrt(square * 1e6) / speed),
            ("p2 falls as the springs return S2's piston", springs * (high - low), end - start, bore),
        ],
    )


def downshift_torque(config: RigConfig) -> Table:
    """Largest M_wej that the printed pressures allow in a downshift while S1 holds and S2 slips: i S1 + S2.

    Both pressures start together, as Annex D has them. S1 has its static friction and M_rest, S2 the kinetic friction of 9.1; the
    springs' forces are those at the kiss point. Inertia and losses before the clutches are left out.

    Parameters
    ----------
    config : RigConfig
        The rig.

    Returns
    -------
    Table
        Time since the start, pressures, the torque of either clutch and the largest M_wej.
    """
    targets, plates = calibrating(), config.plate_pack
    ratio = config.structure.meshes[0].teeth[0] / config.structure.meshes[0].teeth[1]
    rows = []
    for t in INSTANTS:
        p1, p2 = (float(on_curve(targets[name], np.array([t]))[0]) for name in ("ch9_pressure_down_p1", "ch9_pressure_down_p2"))
        holds, slips = (
            max(0.0, c.piston_area * p + c.force_per_pressure_squared * p * p - c.spring_preload - c.spring_rate * c.clearance)
            for c, p in ((config.clutch_s1, p1), (config.clutch_s2, p2))
        )
        s1 = float(thesis(plates, holds, plates.friction_static, plates.friction_spline)) + plates.rest_torque
        s2 = float(thesis(plates, slips, KINETIC, plates.friction_spline))
        rows.append((t, p1, p2, s1, s2, ratio * s1 + s2))
    return Table(
        "Largest M_wej that the pressures of Annex D allow in a downshift, over the time since both began to change.",
        {"time": "ms", "p1": "MPa", "p2": "MPa", "S1": "Nm", "S2": "Nm", "M_wej": "Nm"},
        rows,
    )


def plateaus(config: RigConfig) -> Table:
    """Oil that S2 must still hold at the order of each series of ZR-P2, if its pressure stays level before the plateau's end.

    From an empty line and a piston that is back, as the response (7.5) and Annex D's p2 have it at the currents of series 10, the
    piston meets the plates at the sum of the delay and of the fill. p2 can only stay at the level of P1-P2 (7.3.2) when that is
    before P2, so what the supply's bore delivers from P2 to this contact must have been in line and cylinder. At less current than
    that of series 10 the valve opens no earlier; up to 230 mA it opens at most 10 ms earlier, and the valve's lag is left out.

    Parameters
    ----------
    config : RigConfig
        The rig.

    Returns
    -------
    Table
        Series, current and end of the plateau, contact and the current at that time, the oil and its share of all oil up to there.
    """
    rows, clutch = calibrating(), config.clutch_s2
    rise = rows["ch9_pressure_up_p2"].pieces
    contact = rows["valve_delay_zr_p2"].printed[0] + rise[LAST][0]
    flow = clutch.piston_area**2 / clutch.spring_rate * 1e6 * rise[FILL][2][0]
    whole = clutch.drained_volume + clutch.piston_area * clutch.clearance
    out = []
    for series in load_procedure("profile_series").series():
        if PLATEAU not in series.overrides:
            continue
        (ends, level), (full, most) = ([1e-3 * float(x) for x in series.overrides[p].split()[::2]] for p in (PLATEAU, RAMP))
        left = flow * (contact - ends)
        out.append((series.label, level, ends, contact, float(np.interp(contact, (ends, full), (level, most))), left, left / whole))
    return Table(
        "Oil that S2 must hold at the order, if p2 stays level before the end of the plateau P1-P2 (7.3.2), by (7.5) and Annex D.",
        {"series": "", "plateau": "mA", "ends": "ms", "contact": "ms", "current": "mA", "oil": "cm3", "share": "%"},
        out,
    )


CALCULATIONS = {"drains": drains, "downshift_torque": downshift_torque, "plateaus": plateaus}
