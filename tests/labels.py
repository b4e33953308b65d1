# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the labels of a drawn figure hide and what strikes them through; the tests of figures use it."""

import itertools

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.path import Path
from matplotlib.transforms import Bbox


def hidden(figure: Figure) -> list[str]:
    """Returns a sentence for each label that lies over another one, beside its plot or over an extreme of a curve."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    found = over_each_other([(text.get_text(), text.get_window_extent(renderer)) for text in figure.texts])
    for axes in figure.axes:
        labels = [(text.get_text(), text.get_window_extent(renderer)) for text in axes.texts if text.get_text().strip()]
        found += over_each_other(labels)
        plot = axes.bbox.padded(1)
        inside = [plot.x0 <= box.x0 and box.x1 <= plot.x1 and plot.y0 <= box.y0 and box.y1 <= plot.y1 for _, box in labels]
        found += [f"'{one}' is beyond its plot" for (one, _), kept in zip(labels, inside) if not kept]
        for line in axes.lines:
            x, y = np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)
            low, high = sorted(axes.get_xlim())
            shown = (x >= low) & (x <= high) & np.isfinite(y)
            if line.get_transform() is not axes.transData or not shown.any() or len(x) == 2:
                continue  # leaders and levels
            for at in (y[shown].argmin(), y[shown].argmax()):
                point = axes.transData.transform((x[shown][at], y[shown][at]))
                found += [
                    f"'{one}' is over an extreme of {line.get_label()}, {y[shown][at]:.4g} at {x[shown][at]:.4g}"
                    for one, box in labels
                    if box.contains(*point)
                ]
    return found


def over_each_other(labels: list[tuple[str, Bbox]]) -> list[str]:
    """Returns a sentence for each pair of labels that overlap."""
    pairs = itertools.combinations([(text, box.padded(-0.5)) for text, box in labels], 2)
    return [f"'{one}' is over '{other}'" for (one, box), (other, beside) in pairs if box.overlaps(beside)]


def struck(figure: Figure) -> list[str]:
    """Returns the labels that a curve or a line crosses, each once."""
    renderer, found = FigureCanvasAgg(figure).get_renderer(), []
    for axes in figure.axes:
        labels = [(text.get_text(), text.get_window_extent(renderer).padded(-1)) for text in axes.texts]
        for line in axes.lines:
            if line.get_linestyle() == "None":
                continue  # points
            whole = line.get_transform().transform(line.get_xydata())
            for part in np.ma.clump_unmasked(np.ma.masked_array(whole[:, 1], ~np.isfinite(whole).all(axis=1))):
                path = Path(whole[part])
                found += [one for one, box in labels if len(path) > 1 and path.intersects_bbox(box, filled=False)]
    return sorted(set(found))
