# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The colours of curves and phases can be told apart, also by the colour-blind, and stand out from what lies behind them."""

import itertools

import numpy as np
import pytest

from rig_nodes.analysis import FILL, INERTIA, INTERRUPTED, TORQUE
from rig_nodes.view.palette import (
    CURVES,
    DARK,
    GROUND,
    INK,
    LIGHT,
    LIMIT,
    MET,
    MIDDLE,
    NOTE,
    ON_GRADE,
    PHASES,
    SETTLING,
    rgb,
    with_variables,
)

LEAST = 10.0  # difference of two colours, CIEDE2000
# Machado, Oliveira and Fernandes 2009, table 1 at severity 1.0, for linear RGB
SEEN = {
    "normal": np.eye(3),
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
XYZ = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]])  # sRGB
WHITE = (0.95047, 1.0, 1.08883)  # D65
TOUCHING = [(FILL, TORQUE), (FILL, INTERRUPTED), (FILL, INERTIA), (TORQUE, INERTIA), (INTERRUPTED, INERTIA), (INERTIA, SETTLING)]
BOTH = pytest.mark.parametrize("palette", [LIGHT, DARK], ids=["light", "dark"])


def linear(colour):
    share = np.array([int(colour[place : place + 2], 16) for place in (1, 3, 5)]) / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def lab(colour, seen):
    xyz = XYZ @ np.clip(np.array(SEEN[seen]) @ linear(colour), 0.0, 1.0) / WHITE
    x, y, z = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return 116 * y - 16, 500 * (x - y), 200 * (y - z)


def difference(one, other, seen):
    """CIEDE2000, as CIE 142 has it."""
    (l1, a1, b1), (l2, a2, b2) = lab(one, seen), lab(other, seen)
    mean = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2
    grey = 1 + 0.5 * (1 - np.sqrt(mean**7 / (mean**7 + 25.0**7)))
    c1, c2 = np.hypot(grey * a1, b1), np.hypot(grey * a2, b2)
    h1, h2 = (np.degrees(np.arctan2(b, grey * a)) % 360 for a, b in ((a1, b1), (a2, b2)))
    turn = (h2 - h1 + 180) % 360 - 180
    level, chroma, hue = (l1 + l2) / 2, (c1 + c2) / 2, h1 + turn / 2
    t = 1 - 0.17 * np.cos(np.radians(hue - 30)) + 0.24 * np.cos(np.radians(2 * hue))
    t += 0.32 * np.cos(np.radians(3 * hue + 6)) - 0.2 * np.cos(np.radians(4 * hue - 63))
    dl = (l2 - l1) / (1 + 0.015 * (level - 50) ** 2 / np.sqrt(20 + (level - 50) ** 2))
    dc = (c2 - c1) / (1 + 0.045 * chroma)
    dh = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(turn / 2)) / (1 + 0.015 * chroma * t)
    rotation = 2 * np.sqrt(chroma**7 / (chroma**7 + 25.0**7)) * np.sin(np.radians(60 * np.exp(-(((hue % 360 - 275) / 25) ** 2))))
    return float(np.sqrt(dl**2 + dc**2 + dh**2 - rotation * dc * dh))


def contrast(one, other):
    """WCAG 2.1."""
    low, high = sorted(float(linear(colour) @ XYZ[1]) for colour in (one, other))
    return (high + 0.05) / (low + 0.05)


def test_the_difference_is_that_of_the_published_examples():
    # Sharma, Wu and Dalal 2005 give pairs in Lab; these two are white and black, and red and green of sRGB
    assert difference("#ffffff", "#000000", "normal") == pytest.approx(100.0, abs=0.01)
    assert difference("#ff0000", "#00ff00", "normal") == pytest.approx(86.6, abs=0.1)


@BOTH
@pytest.mark.parametrize("seen", SEEN)
def test_curves_and_phases_that_touch_differ_for_every_eye(palette, seen):
    for one, other in [*itertools.combinations(CURVES, 2), *TOUCHING]:
        assert difference(palette[one], palette[other], seen) >= LEAST, (one, other)


@BOTH
def test_curves_stand_out_from_ground_and_phases_and_words_can_be_read(palette):
    for behind in (GROUND, *PHASES):
        for curve in (*CURVES, LIMIT):
            assert contrast(palette[curve], palette[behind]) >= 3.0, (curve, behind)
        for words in (INK, NOTE):
            assert contrast(palette[words], palette[behind]) >= 4.5, (words, behind)
    for words in (LIMIT, MET):
        assert contrast(palette[words], palette[GROUND]) >= 4.5
    for grade in ("good", "fair", "poor", "failed"):
        assert contrast(ON_GRADE, palette[grade]) >= 4.5


def test_curves_of_the_viewer_stand_out_from_a_light_and_from_a_dark_window_for_every_eye():
    for ground in ("#ffffff", "#0d0d0d"):
        for name in CURVES:
            measured, demanded = ("#" + bytes(rgb(name, pale)).hex() for pale in (False, True))
            assert contrast(measured, ground) >= 3.0 and contrast(demanded, ground) >= 1.95, (name, ground)
    for seen in SEEN:
        for one, other in itertools.combinations(MIDDLE.values(), 2):
            assert difference(one, other, seen) >= LEAST, (one, other)


def test_a_page_can_exchange_the_palette_of_a_drawing():
    assert list(LIGHT) == list(DARK) and len(set(LIGHT.values())) == len(LIGHT)
    assert with_variables(f'style="fill: {LIGHT[TORQUE]}; stroke: #123456" url(#pdeadbe)') == (
        'style="fill: var(--torque-phase); stroke: #123456" url(#pdeadbe)'
    )
