# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Finds curves, legends, texts and state bars in a picture of a view; used by the tests that look at pictures."""

import io

import numpy as np
from PIL import Image

from rig_nodes.rig.configuration import load_rig
from rig_nodes.view.pages import Pages

PAGES = Pages(load_rig("hydmag").as_dict())
LONGEST = 300.0  # s for the requests to one viewer on a busy machine
DOT = 5  # px; a square of this size fits into a legend's dot, but into no curve without noise
LEGEND = 0.4  # share of the width in which the legend lies
WHITE = 200  # least brightness of each channel of a text
BAR = 0.78  # brightness of a state's bar relative to its given colour


def image_of(png: bytes) -> np.ndarray:
    """Returns a picture as height x width x RGB."""
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)


def has(image: np.ndarray, colour, tolerance: int = 10) -> np.ndarray:
    """Returns which pixels have a colour, apart from smoothed edges."""
    return np.abs(image - np.array(colour)).max(axis=2) <= tolerance


def curve_pixels(image: np.ndarray, colour, side: str = "right") -> int:
    """Returns the pixels of a colour outside the legend; ``side`` is the side on which the legend lies."""
    width = image.shape[1]
    part = image[:, : int((1 - LEGEND) * width)] if side == "right" else image[:, int(LEGEND * width) :]
    return int(has(part, colour).sum())


def dots(image: np.ndarray, colour) -> list[tuple[int, int]]:
    """Returns row and column of the filled squares of a colour: the dots of a legend."""
    squares = has(image, colour)
    for _ in range(2):  # along one side, then, turned, along the other
        squares = np.logical_and.reduce([squares[k : len(squares) - DOT + 1 + k] for k in range(DOT)]).T
    return [tuple(place) for place in np.argwhere(squares)]


def legend_text(image: np.ndarray, colour) -> int:
    """Returns the number of bright pixels to the right of the last dot of a colour, behind its curve; 0 without a dot."""
    found = dots(image, colour)
    if not found:
        return 0
    end = max(column for _, column in found)
    row, column = next(one for one in found if one[1] > end - DOT)
    return text_pixels(image[max(0, row - 4) : row + DOT + 4, column + 2 * DOT :])


def text_pixels(image: np.ndarray) -> int:
    """Returns the pixels as bright as text."""
    return int((image.min(axis=2) >= WHITE).sum())


def lanes(image: np.ndarray) -> list[np.ndarray]:
    """Returns the bars of a picture of states, from the top.

    Each is one row of RGB from the bar's upper edge, free of text, up to the bar's end.
    """
    bright = image.max(axis=2) > 50
    full = bright.mean(axis=1) > 0.55  # dark letters on a bar, which ends with the run
    edges = np.flatnonzero(np.diff(np.concatenate([[False], full, [False]]).astype(int)))
    rows = [start + 2 for start, end in edges.reshape(-1, 2) if end - start >= 10]
    return [image[row, : 1 + np.flatnonzero(bright[row])[-1]] for row in rows]


def upright(image: np.ndarray, colour) -> np.ndarray:
    """Returns the columns in which a line of a colour, one pixel wide, goes through most of a plot.

    A line between two columns of pixels has a part of its colour in both.
    """
    plot = image[:-18]
    ground = np.median(plot, axis=(0, 1))
    way = np.array(colour) - ground
    part = ((plot - ground) @ way) / (way @ way)
    of_colour = np.abs(plot - ground - part[:, :, None] * way).max(axis=2) < 30
    part = np.where(of_colour & (part > 0.2), part, 0.0)
    both = part + np.roll(part, -1, axis=1)
    return np.flatnonzero((np.abs(both - 1.0) < 0.35).mean(axis=0) > 0.55)


def of_state(bar: np.ndarray, signal: str, label: str) -> np.ndarray:
    """Returns which pixels of a bar have the colour of a state."""
    colour = np.array(PAGES.state_colour(signal, label)) * BAR
    return np.abs(bar - colour).max(axis=1) <= 12
