# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Finding curves, legends, texts and state bars in a picture of a view; used by the tests that look at pictures."""

import io

import numpy as np
from PIL import Image

from rig_nodes.view.pages import Pages

PAGES = Pages()
LONGEST = 300.0  # s for what one viewer is asked, on a busy machine
DOT = 5  # px; a legend's dot holds a square of this size, no curve does
LEGEND = 0.3  # of the width, in which the legend lies
WHITE = 200  # of each channel of a text, at least
BAR = 0.78  # brightness of a state's bar over the colour it is given


def image_of(png: bytes) -> np.ndarray:
    """Height x width x RGB."""
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)


def has(image: np.ndarray, colour, tolerance: int = 10) -> np.ndarray:
    """Which pixels have a colour, but for smoothed edges."""
    return np.abs(image - np.array(colour)).max(axis=2) <= tolerance


def curve_pixels(image: np.ndarray, colour, side: str = "right") -> int:
    """Pixels of a colour where no legend lies. side: where the legend is."""
    width = image.shape[1]
    part = image[:, : int((1 - LEGEND) * width)] if side == "right" else image[:, int(LEGEND * width) :]
    return int(has(part, colour).sum())


def dots(image: np.ndarray, colour) -> list[tuple[int, int]]:
    """Row and column of the filled squares of a colour: the dots of a legend."""
    windows = np.lib.stride_tricks.sliding_window_view(has(image, colour), (DOT, DOT))
    return [tuple(place) for place in np.argwhere(windows.all(axis=(2, 3)))]


def legend_text(image: np.ndarray, colour) -> int:
    """Bright pixels to the right of the dot of a colour; 0 without a dot."""
    found = dots(image, colour)
    if not found:
        return 0
    row, column = found[0]
    return text_pixels(image[max(0, row - 4) : row + DOT + 4, column + 2 * DOT :])


def text_pixels(image: np.ndarray) -> int:
    """Pixels as bright as text."""
    return int((image.min(axis=2) >= WHITE).sum())


def lanes(image: np.ndarray) -> list[np.ndarray]:
    """The bars of a picture of states, from the top: one row of RGB each, of the bar's upper edge, free of text."""
    full = (image.max(axis=2) > 50).mean(axis=1) > 0.9  # dark letters on a bar
    edges = np.flatnonzero(np.diff(np.concatenate([[False], full, [False]]).astype(int)))
    return [image[start + 2] for start, end in edges.reshape(-1, 2) if end - start >= 10]


def share(bar: np.ndarray, signal: str, label: str) -> float:
    """Part of a bar's length that has the colour of a state."""
    colour = np.array(PAGES.state_colour(signal, label)) * BAR
    return float((np.abs(bar - colour).max(axis=1) <= 12).mean())
