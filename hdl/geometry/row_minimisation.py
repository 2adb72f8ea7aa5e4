"""The rectification that needs the fewest rows of line buffer.

Row-aligned, or column-aligned, stays a pair of views under three changes that are made to both at once: a rotation
about the baseline, a shift of the principal point's row, and another focal length. They bend and scale the map, and so
decide how far it reaches up and down; a rectification is usually chosen without a thought to that.

Fewer rows are worth having only if the pictures stay what they were. What a change may cost is one number, the share
that is lost, for each of

- the field of view: of what a rectified frame showed of the scene, by solid angle, the part that it shows no more,
- the part of the frame that has a source, so that no black is let in instead,
- the focal length, so that the view is not made coarser instead.
"""

from dataclasses import replace
from functools import cached_property

import cv2
import numpy as np
from scipy.optimize import differential_evolution

from hdl.calibration.stance import turn_about_view
from hdl.geometry.view import View

FARTHEST_TURN = 45.0  # degrees about the view: more than a frame of rows is needed anyhow
_CELLS = 40  # of the grid that stands for the frame during the search, each way
_GENERATIONS = 60
_PRICE = 20.0  # rows that all of the view is worth: of two solutions that are all but equal, the one that loses less
_CANDIDATES = 8  # of the search that are evaluated at every pixel
_RESERVE = 0.97  # of the allowed loss: the grid does not see every pixel


def minimise_rows(views: dict[str, View], max_loss: float, *, center: bool, focal: bool) -> dict[str, View]:
    """``views`` rectified anew so that their line buffers have the fewest rows, all cameras' together.

    Parameters
    ----------
    views : dict of side to View
        Row-aligned or column-aligned. The rows counted are those of their maps, with the lens where they have it.
    max_loss : float
        The largest `loss` that is allowed, 0 to 0.5.
    center, focal : bool
        Whether the principal point's row, the focal length, may change. The rotation always may.

    Returns
    -------
    dict of side to View
        Aligned as before. Never of more rows, by the exhaustive count of View.window; the same ones if nothing
        better was found, or if images are turned so far that nothing here can help. The same on every call.
    """
    if any(abs(turn_about_view(view.R)) > FARTHEST_TURN for view in views.values()):
        return views
    height = next(iter(views.values())).height
    reach = 0.3 * height  # px; what lies further off costs more than half of the view
    limits = [
        (-reach, reach),
        (-reach, reach) if center else (0.0, 0.0),
        (np.log1p(-max_loss) * height, -2 * np.log1p(-max_loss) * height) if focal else (0.0, 0.0),
    ]
    free = [i for i, (low, high) in enumerate(limits) if low < high]
    before = {side: _Sampled(view) for side, view in views.items()}
    # Grid and pixels differ by what lies along the frame's edge, a row of pixels at most.
    allowed = max(0.0, _RESERVE * max_loss - 1 / height)

    def cost(values):
        step = np.zeros(3)
        step[free] = values
        after = {side: _Sampled(view) for side, view in _changed(views, step).items()}
        if not all(sampled.spread < np.inf for sampled in after.values()):
            return 1e9
        lost = max(before[side].lost(after[side]) for side in views)
        spread = sum(sampled.spread for sampled in after.values())
        return spread + _PRICE * max(lost, 0.0) + 1e5 * max(0.0, lost - allowed)

    found = differential_evolution(
        cost, [limits[i] for i in free], x0=np.zeros(len(free)), popsize=8, maxiter=_GENERATIONS, tol=1e-3, rng=1,
        polish=False,
    )  # fmt: skip
    best, fewest = views, _rows(views)
    for index in np.argsort(found.population_energies, kind="stable")[:_CANDIDATES]:
        step = np.zeros(3)
        step[free] = np.round(found.population[index], 3)
        candidate = _changed(views, step)
        if (rows := _rows(candidate)) < fewest and loss(views, candidate) <= max_loss:
            best, fewest = candidate, rows
    return best


def loss(before: dict[str, View], after: dict[str, View]) -> float:
    """The share that ``after`` loses of ``before``: of field of view, of the filled frame or of focal length.

    The largest of the three, and of both cameras; 0 where nothing is lost. Exhaustive over all pixels.
    """
    return max(0.0, *(_Whole(before[side]).lost(_Whole(after[side])) for side in before))


def _rows(views):
    return sum(view.window.rows for view in views.values())


def _changed(views, step):
    """``views`` turned about the baseline, shifted and enlarged by ``step``.

    All three in px at the edge of the frame, about: rotation by step[0] / f, principal point down by step[1], focal
    length times exp(step[2] / height).
    """
    turn, shift, growth = step
    result = {}
    for side, view in views.items():
        K, position = view.P[:, :3].copy(), np.linalg.solve(view.P[:, :3], view.P[:, 3])
        K[:2, :2] *= np.exp(growth / view.height)
        K[1, 2] += shift
        axis = [1.0, 0.0, 0.0] if view.aligned == "rows" else [0.0, 1.0, 0.0]
        about_baseline = cv2.Rodrigues(turn / view.P[1, 1] * np.array(axis))[0]
        P = K @ np.column_stack([np.eye(3), about_baseline @ position])
        result[side] = replace(view, R=about_baseline @ view.R, P=P)
    return result


class _Measured:
    """What is weighed of a view.

    ``x`` and ``y`` are rectified pixels, ``area`` how many px each stands for and has a source for.
    """

    def __init__(self, view, x, y, area):
        self._view = view
        self._x, self._y, self._area = x, y, area
        self._filled = area.sum()

    def lost(self, after) -> float:
        """The largest share that ``after``, measured alike, has lost; below 0 if it has gained of everything."""
        if not self._filled:  # there was nothing to lose
            return 0.0
        fill = after._filled / self._filled
        return float(1 - min(self._still_seen(after._view), fill, after._view.P[1, 1] / self._view.P[1, 1]))

    def _still_seen(self, after):
        """The share of the solid angle that is shown here and lies inside the frame of ``after``, too."""
        to_after = after.P[:, :3] @ after.R @ self._view.ray
        x, y, z = (row[0] * self._x + (row[1] * self._y + row[2]) for row in to_after)
        along, across = self._spacing
        seen = _within(x / z, after.width, along) * _within(y / z, after.height, across) * (z > 0)
        return (seen * self._solid_angle).sum() / self._solid_angle.sum()

    @cached_property
    def _solid_angle(self):
        """Of each pixel's source area, in units that do not matter."""
        P = self._view.P
        x, y = (self._x - P[0, 2]) / P[0, 0], (self._y - P[1, 2]) / P[1, 1]
        return self._area / (1 + x * x + y * y) ** 1.5


class _Whole(_Measured):
    """At every pixel."""

    _spacing = 0.0, 0.0

    def __init__(self, view):
        y, x = np.ogrid[: view.height, : view.width]
        super().__init__(view, x, y, view.inside)


class _Sampled(_Measured):
    """By a grid of cells; also ``spread``, px, which the rows of line buffer follow."""

    def __init__(self, view):
        x, y = (np.linspace(0, extent - 1, _CELLS + 1) for extent in (view.width, view.height))
        width, height = view.source_size
        scale = width / view.width, height / view.height
        with np.errstate(all="ignore"):
            u, v = view.project(x, y[:, None])
            self.spread = _spread(view, v - y[:, None] * scale[1], u, v) if view.nearest() > 0 else np.inf
        self._spacing = x[1], y[1]
        middle = [(w[1:, 1:] + w[1:, :-1] + w[:-1, 1:] + w[:-1, :-1]) / 4 for w in (u, v)]
        # The part of a cell that lies inside the source is smooth in what is searched for; whole cells would be coarse.
        area = _within(middle[0], width, x[1] * scale[0]) * _within(middle[1], height, y[1] * scale[1])
        super().__init__(view, (x[1:] + x[:-1]) / 2, (y[1:] + y[:-1])[:, None] / 2, area)


def _within(position, extent, spacing):
    """The part, 0 to 1, of cells ``spacing`` px wide around each ``position`` that lies in an image ``extent`` px wide.

    With ``spacing`` 0, whether the pixel nearest to the position is one of the image.
    """
    if not spacing:
        return (position >= -0.5) & (position <= extent - 0.5)
    return np.clip(0.5 + np.minimum(position, extent - 1 - position) / spacing, 0, 1)


def _spread(view, offset, u, v):
    """Rows between the highest and the lowest tap inside the source, relative to the row that is due; px, not rounded.

    ``offset`` is that from it to v at the corners of the cells. Where the source's edge runs between two corners the
    offset there is interpolated.
    """
    width, height = view.source_size
    depth = 1 + np.minimum(np.minimum(u, width - 1 - u), np.minimum(v, height - 1 - v))  # px inside
    found = [offset[depth >= 0]]
    for near, far in (((slice(-1),), (slice(1, None),)), ((..., slice(-1)), (..., slice(1, None)))):
        crossing = (depth[near] >= 0) != (depth[far] >= 0)
        start, end = depth[near][crossing], depth[far][crossing]
        first, last = offset[near][crossing], offset[far][crossing]
        found.append(first + (last - first) * (start / (start - end)))
    offsets = np.concatenate(found)
    offsets = offsets[np.isfinite(offsets)]
    return max(offsets.max() + 1, 0) - offsets.min() if offsets.size else np.inf
