"""Records of the clutch bench (8.1.6) and of the spring and cylinder benches (8.1.4), from the bench's own parts.

Used by validation.programme. The friction of chapter 8 is not printed: STATED holds the values that reproduce its
comparison of models (docs/friction_models.md). With them the rig's packs follow the thesis's model, so k_kor
against that model is 1 by construction; what is compared is what the other models make of the same packs.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..plant.friction import bench
from ..plant.friction.bench import PACKS, BenchPack
from .records import Record

# friction [-] of the lined and the steel plates and of all splines; a reading, not a measurement
STATED = {"lined": 0.30, "steel": 0.12, "spline": 0.058}
SPRING_TRAVEL = 2e-3  # m of the bench's springs at contact; own, it shifts all clamp forces alike
CYLINDER_PRESSURES = np.arange(1.0e6, 3.51e6, 0.5e6)  # Pa; (8.2) was measured up to 3.5 MPa
ALLOWED_PRESSURE = 3e6  # Pa on the plates, thesis 3.3; 8.4 extrapolates to it
GOOD = 0.10  # chapter 8 speaks of good agreement up to 10 %
MODELS = ("thesis", "osinski", "traditional")
NO_REST = ("nothing printed says what makes an unclamped pack stick; the bench's packs have no M_rest of their own, "
           "it is an input of (6.56)")


def clutch_bench() -> list[Record]:
    """m_eks, model_torque_nm, k_kor, k_kor_error, m_eks_trend_above_nm, m_rest_nm of every pack of chapter 8."""
    records = [record for pack in PACKS.values() for n in pack.surfaces for record in _pack(pack, n)]
    return records + _off_in_most(records)


def _pack(pack: BenchPack, surfaces: int) -> Iterator[Record]:
    geometry = pack.geometry(surfaces)
    area = np.pi * (geometry.outer_radius**2 - geometry.inner_radius**2)
    force = bench.clamp_force(CYLINDER_PRESSURES, SPRING_TRAVEL)
    lined = pack.name == "50x76"
    friction = STATED["lined" if lined else "steel"]
    torques = bench.slip_torques(geometry, force, friction, STATED["spline"])
    measured, pressure = torques["thesis"], force / area
    slope, offset = np.polyfit(pressure, measured, 1)
    full = bench.slip_torques(geometry, ALLOWED_PRESSURE * area, friction, STATED["spline"])
    # thicknesses were mixed in the gearbox's packs
    for thickness in (None,) if lined else pack.plate_thickness:
        place = {"ring": pack.name, "surfaces": surfaces}
        if thickness is not None:
            place["thickness"] = thickness
        for p, torque in zip(pressure, measured):
            yield Record("clutch_bench", {**place, "pressure": float(p)}, {"m_eks": float(torque)})
        yield Record("clutch_bench", place, {"m_rest_nm": None}, {"m_rest_nm": NO_REST})
        for model in MODELS:
            k_kor = float(slope / np.polyfit(pressure, torques[model], 1)[0])
            named = {**place, "model": model}
            yield Record("clutch_bench", named, {"k_kor": k_kor, "k_kor_error": abs(k_kor - 1.0),
                                                 "model_torque_nm": float(torques[model][-1])})
            above = [*zip(pressure, torques[model]), (ALLOWED_PRESSURE, full[model])]
            for p, torque in above:
                yield Record("clutch_bench", {**named, "pressure": float(p)},
                             {"m_eks_trend_above_nm": float(slope * p + offset - torque)})


def _off_in_most(records) -> list[Record]:
    """For each model the class over all packs, held at every ring so that a row may ask for any."""
    out = []
    for model in MODELS:
        off = [r.values["k_kor_error"] > GOOD for r in records if r.conditions.get("model") == model
               and "k_kor_error" in r.values]
        word = "off in most" if 2 * sum(off) > len(off) else "close in most"
        out += [Record("clutch_bench", {"ring": ring, "model": model}, {"k_kor": word}) for ring in PACKS]
    return out


def spring_bench() -> list[Record]:
    """Forces of the bench's springs over their travel ``s`` and of its cylinder over the pressure, and where that
    begins."""
    records = [Record("spring_bench", {"s": float(s)}, {"spring_force_n": float(bench.spring_force(s))})
               for s in np.linspace(0.0, bench.SPRING_TRAVEL, 81)]
    pressures = np.linspace(0.0, 3.5e6, 701)
    forces = bench.cylinder_force(pressures)
    records += [Record("spring_bench", {"pressure": float(p)}, {"cylinder_force_n": float(f)})
                for p, f in zip(pressures, forces)]
    begins = float(pressures[np.flatnonzero(forces > 0.0)[0]])
    return records + [Record("spring_bench", {}, {"cylinder_start_mpa": begins})]
