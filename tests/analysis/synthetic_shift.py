# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shifts made by hand, with all times known, for the tests of the analysis."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from types import SimpleNamespace

import numpy as np

from rig_nodes.bags.logged import Recording
from rig_nodes.base.errors import BagError
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.structure import structure_of
from rig_nodes.rig.transmission import transmission_of

BOX = load_rig("hydmag").transmission

I1, I2 = 47 / 34, 41 / 40
RPM = 30 / pi
PERIOD = 1e-4
ENCODER = 2 * pi * 0.017  # rad/s that the laboratory's encoders resolve


@dataclass
class Shift:
    """Times in s after the order; the order comes at 1 s (sample 10000)."""

    up: bool = True
    rpm: float = 1500.0
    fall: float = 0.45  # releasing pressure starts to fall
    depart: float = 0.60  # n_wyj leaves its old value
    end: float = 0.70  # n_wyj reaches its new value
    settle: float = 0.80  # M_wej comes to rest
    peak: float = 250.0
    dip: float = 0.0  # share of n_wej / i1 by which n_wyj dips below it before the end
    fall_rate: float = 13.0e6
    engage: float = 0.35  # engaging pressure passes its kiss pressure
    release: float = 0.62  # releasing pressure passes its kiss pressure
    length: float = 3.0

    @property
    def overlap(self) -> float:
        """Time for which both clutches have a tenth of their closed capacity; negative for one in which neither has."""
        kiss_old, _ = (clutch.kiss_pressure for clutch in BOX.clutches[:: 1 if self.up else -1])
        bend = self.fall + (2.3e6 - 0.8e6) / self.fall_rate
        return self.release - 0.1 * (2.3e6 - kiss_old) / (0.8e6 - kiss_old) * (self.release - bend) - (self.engage + 0.03)

    def channels(self) -> dict[str, np.ndarray]:
        t = np.arange(int(round(self.length / PERIOD))) * PERIOD - 1.0
        w = np.full(t.size, self.rpm / RPM)
        old, new = (I1, I2) if self.up else (I2, I1)
        if self.dip:
            middle = self.depart + 0.6 * (self.end - self.depart)
            points = [self.depart, middle, self.end], [1 / old, (1 - self.dip) / I1, 1 / new]
        else:
            points = [self.depart, self.end], [1 / old, 1 / new]
        n_wyj = w * np.interp(t, *points)
        m_wyj = np.full(t.size, 80.0)
        m_wej = np.interp(
            t, [self.fall, self.end - 1e-2, self.end - 5e-3, self.end, self.settle], [65.0, self.peak, self.peak, 150.0, 88.0]
        )
        kiss_old, kiss_new = (clutch.kiss_pressure for clutch in BOX.clutches[:: 1 if self.up else -1])
        bend = self.fall + (2.3e6 - 0.8e6) / self.fall_rate
        old_p = np.interp(t, [self.fall, bend, self.release, self.release + 0.06], [2.3e6, 0.8e6, kiss_old, 0.0])
        new_p = np.interp(t, [self.engage - 0.1, self.engage, self.engage + 0.3], [0.0, kiss_new, 2.3e6])
        p1, p2 = (old_p, new_p) if self.up else (new_p, old_p)
        return {"M_wej": m_wej, "n_wej": w, "M_wyj": m_wyj, "n_wyj": n_wyj, "p1": p1, "p2": p2}

    def recording(self, noise_seed: int | None = None, **replace) -> Recording:
        channels = self.channels() | replace
        if noise_seed is not None:
            channels = noisy(channels, noise_seed)
        return Recording(0.0, PERIOD, channels, [(1.0, 1, 2) if self.up else (1.0, 2, 1)], BOX)


def noisy(channels: dict[str, np.ndarray], seed: int) -> dict[str, np.ndarray]:
    """Returns the channels as the instruments show them: class 0.25 of range as 2-sigma scatter, encoders rounded to their step."""
    rng = np.random.default_rng(seed)
    sigma = {"M_wej": 0.625, "M_wyj": 0.625, "p1": 0.05e6, "p2": 0.031e6}
    out = {}
    for name, values in channels.items():
        if name in sigma:
            out[name] = values + rng.normal(0.0, sigma[name], values.size)
        else:
            out[name] = np.round((values + rng.normal(0.0, ENCODER / 3, values.size)) / ENCODER) * ENCODER
    return out


class FakeBag:
    """The parts of a bag that the report needs, from arrays."""

    began = True
    recorded_from = 0.0
    types = {name: topic.ros_type for name, topic in load_rig("hydmag").catalogue.topics.items()}
    record = load_rig("hydmag").as_dict()
    structure = structure_of(record["structure"])
    transmission = transmission_of(record)

    def run_info(self):
        return {}

    def check_began(self):
        pass

    def __init__(self, recording: Recording, messages=None, gaps=None, events=()):
        self.recording, self._messages, self._gaps = recording, messages or {}, gaps or {}
        self._events = list(events)

    def logger(self, fill=False):
        r = self.recording
        return SimpleNamespace(t0=r.t0, period=r.period, channels=r.channels)

    def events(self):
        return self._events

    def messages(self, topic):
        return iter(self._messages.get(topic, []))

    def fields(self, topic, names):
        held = self._messages.get(topic, [])
        if missing := [name for name in names for _, message in held[:1] if not hasattr(message, name)]:
            raise BagError(f"{topic} has no field '{missing[0]}'")
        return np.array([t * 1e-9 for t, _ in held]), [np.array([getattr(m, n) for _, m in held]) for n in names]

    def gaps(self):
        return self._gaps
