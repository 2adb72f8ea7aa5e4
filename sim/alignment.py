"""How well a pair of coordinate maps aligns rows, measured at points whose source positions are known."""

from typing import NamedTuple

import numpy as np

_CELLS = 64  # of the grid for the first guess, along the longer side
_REACH = 4  # px to either side over which slopes are taken: wide enough to smooth the steps of a quantised map
_SLOPED, _STEPS = 5, 25  # Newton steps with new slopes, and altogether


class RowDifference(NamedTuple):
    """Difference of the rows, or of the columns, on which the two images show a point.

    Members
    -------
    mean, median, percentile_95, max : float
        Of its magnitude, px.
    signed_mean : float
        Left less right, px.
    n : int
        Points that both images show.
    """

    mean: float
    median: float
    percentile_95: float
    max: float
    signed_mean: float
    n: int

    @classmethod
    def of(cls, differences):
        """Of these differences, left less right, px; ValueError where there are none."""
        if not len(differences):
            raise ValueError("points: none is shown in both images")
        magnitude = np.abs(differences)
        return cls(
            float(magnitude.mean()),
            float(np.median(magnitude)),
            float(np.percentile(magnitude, 95)),
            float(magnitude.max()),
            float(np.mean(differences)),
            len(magnitude),
        )


def in_px(coordinates):
    """(u, v) of `hdl.geometry.coordinates.Coordinates`, px, float64."""
    return tuple(axis * 2.0**-coordinates.fraction_bits for axis in (coordinates.u, coordinates.v))


def rectified_positions(map_u, map_v, points):
    """Where the rectified image shows source positions: the coordinate map, inverted.

    Parameters
    ----------
    map_u, map_v : (height, width)
        Source coordinates of every rectified pixel, px; between pixels they are interpolated linearly.
    points : (n, 2)
        Source positions, px.

    Returns
    -------
    (n, 2) float64
        Rectified px; NaN for positions that the rectified image does not show. Linear interpolation of a lens map
        costs about 0.0003 px; maps in steps give positions as good as the steps.
    """
    maps = np.stack([map_u, map_v], axis=-1).astype(np.float64)
    points = np.asarray(points, np.float64).reshape(-1, 2)
    last = np.array([maps.shape[1] - 1, maps.shape[0] - 1])
    at = _nearest(maps, points)
    with np.errstate(all="ignore"):
        for step in range(_STEPS):
            if step < _SLOPED:
                inverse = _inverse_slopes(maps, at)
            change = np.einsum("nij,nj->ni", inverse, points - _interpolated(maps, at))
            at = at + change
            # A pixel beyond the edge is extrapolated well enough to tell on which side of it a point is.
            at = np.clip(at, -1, last + 1)
        shown = ((at >= 0) & (at <= last) & (np.abs(change) < 1)).all(axis=1)
    return np.where(shown[:, None], at, np.nan)


def row_difference(maps, points, aligned="rows"):
    """Statistics of rows after rectification, or before.

    Parameters
    ----------
    maps : {"left": (u, v), "right": (u, v)} or None
        Coordinate maps as for :func:`rectified_positions`; None leaves the points where they are.
    points : {"left": (n, 2), "right": (n, 2)}
        Source positions of the same n points, as from :func:`sim.scene.visible_points`.
    aligned : "rows" or "columns"
        What the rectification aligns, and so what is compared.

    Returns
    -------
    RowDifference

    Raises
    ------
    ValueError
        When no point is left.
    """
    axis = ("columns", "rows").index(aligned)
    rows = [
        np.asarray(points[side])[:, axis] if maps is None else rectified_positions(*maps[side], points[side])[:, axis]
        for side in ("left", "right")
    ]
    difference = rows[0] - rows[1]
    return RowDifference.of(difference[~np.isnan(difference)])


def _nearest(maps, points):
    """The pixels, out of a coarse grid, that show the source nearest to the points."""
    height, width = maps.shape[:2]
    step = max(1, max(height, width) // _CELLS)
    y, x = (np.append(np.arange(0, n - 1, step), n - 1) for n in (height, width))
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    sources = maps[grid[:, 1], grid[:, 0]]
    grid, sources = grid[np.isfinite(sources).all(axis=1)], sources[np.isfinite(sources).all(axis=1)]
    # |point - source|^2 without |point|^2, which is the same for all sources.
    distance = np.einsum("ij,ij->i", sources, sources) - 2 * points @ sources.T
    return grid[np.argmin(distance, axis=1)].astype(np.float64)


def _interpolated(maps, at):
    height, width = maps.shape[:2]
    x = np.clip(np.floor(np.nan_to_num(at[:, 0])).astype(int), 0, width - 2)
    y = np.clip(np.floor(np.nan_to_num(at[:, 1])).astype(int), 0, height - 2)
    a, b = (at[:, 0] - x)[:, None], (at[:, 1] - y)[:, None]
    above = maps[y, x] * (1 - a) + maps[y, x + 1] * a
    below = maps[y + 1, x] * (1 - a) + maps[y + 1, x + 1] * a
    return above * (1 - b) + below * b


def _inverse_slopes(maps, at):
    """Inverses of the Jacobians d(u, v)/d(x, y), (n, 2, 2)."""
    last = np.array([maps.shape[1] - 1, maps.shape[0] - 1])
    reach = np.minimum(_REACH, last / 2)
    middle = np.clip(at, reach, last - reach)
    x, y = np.array([reach[0], 0]), np.array([0, reach[1]])
    (ux, vx) = ((_interpolated(maps, middle + x) - _interpolated(maps, middle - x)) / (2 * reach[0])).T
    (uy, vy) = ((_interpolated(maps, middle + y) - _interpolated(maps, middle - y)) / (2 * reach[1])).T
    return np.array([[vy, -uy], [-vx, ux]]).transpose(2, 0, 1) / (ux * vy - uy * vx)[:, None, None]
