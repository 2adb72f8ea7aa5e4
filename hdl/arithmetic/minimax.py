"""Least-maximum fits of a map's coordinate by products of functions of the column and of the row."""

import numpy as np
from scipy.optimize import linprog

from hdl.errors import ToolError

GRID = 16  # points along each side of the first grid, and four more for each function along it
TILES = 12  # the frame is searched for violated points in that many tiles a side
EXCHANGES = 40
ABSOLUTE = 1e-6  # precision of the error found, px


def outside_by(u, v):
    """How far outside the source image a pixel's source lies, px, the greater of both axes; 0 inside."""
    height, width = u.shape
    return np.maximum.reduce([-u, u - (width - 1), -v, v - (height - 1), np.zeros_like(u)])


def minimax(across, down, terms, target, allowance, enough=np.inf, precision=0.0):
    """The sum of c[i, j] * across[x, i] * down[y, j] over ``terms`` (i, j) that is closest to ``target``.

    A linear program over a coarse grid, to which points are added where the error is largest until it is largest on the
    points themselves: an exchange. What it yields is within the precision of the least error over the whole frame.

    Parameters
    ----------
    across, down : float64 (width, m), (height, n)
        Functions of the column and of the row, of the order of 1; best orthogonal.
    terms : list of (int, int)
    target : float64 (height, width)
        px
    allowance : float64 (height, width)
        Error that is free at each pixel, px; infinite where it does not matter.
    enough : float
        Give up as soon as the error is known to be larger, px.
    precision : float
        How far from the least error to stop, relative to it.

    Returns
    -------
    coefficients : float64 (m, n)
    error : float
        Over all pixels, beyond the allowance, px; of a fit that was given up a lower bound. After EXCHANGES of points,
        more than any map has needed, that of the last fit.
    """
    height, width = target.shape
    first, second = np.transpose(terms)
    points = _first_points(allowance, across.shape[1], down.shape[1])
    coefficients = np.zeros((across.shape[1], down.shape[1]))
    for _ in range(EXCHANGES):
        y, x = np.divmod(points, width)
        columns = across[x][:, first] * down[y][:, second]
        values, bound = _program(columns, target.ravel()[points], allowance.ravel()[points])
        coefficients[first, second] = values
        if bound > enough:
            return coefficients, bound
        excess = np.abs(down @ coefficients.T @ across.T - target) - allowance
        worst = float(excess.max())
        if worst <= bound * (1 + precision) + ABSOLUTE:
            break
        found = _worst_of_tiles(excess)
        points = np.union1d(points, found[excess.ravel()[found] > bound])
    return coefficients, worst


def _program(columns, target, allowance):
    """Coefficients and the least t with |columns @ coefficients - target| <= t + allowance."""
    ones = np.ones((len(columns), 1))
    result = linprog(
        np.append(np.zeros(columns.shape[1]), 1.0),
        A_ub=np.block([[columns, -ones], [-columns, -ones]]),
        b_ub=np.concatenate([allowance + target, allowance - target]),
        bounds=[(None, None)] * columns.shape[1] + [(0, None)],
        method="highs",
    )
    if not result.success:
        raise ToolError(f"linear program: {result.message}")
    return result.x[:-1], float(result.x[-1])


def _first_points(allowance, m, n):
    """Flat indices of a grid of pixels with the border, and of some more so that there are always some that count."""
    height, width = allowance.shape
    x, y = (
        np.unique(np.linspace(0, size - 1, min(size, GRID + 4 * functions)).round().astype(np.int64))
        for size, functions in ((width, m), (height, n))
    )
    counts = np.isfinite(allowance).ravel()
    grid = (y[:, None] * width + x).ravel()
    some = np.flatnonzero(counts)
    return np.union1d(grid[counts[grid]], some[:: -(-len(some) // GRID**2)])


def _worst_of_tiles(excess):
    """Flat index of the largest element in each tile of the frame."""
    height, width = excess.shape
    found = []
    for rows in np.array_split(np.arange(height), min(TILES, height)):
        for columns in np.array_split(np.arange(width), min(TILES, width)):
            tile = excess[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
            y, x = np.unravel_index(tile.argmax(), tile.shape)
            found.append((rows[0] + y) * width + columns[0] + x)
    return np.array(found)
