"""Least-maximum fits of a map's coordinate by products of functions of the column and of the row."""

import numpy as np
from scipy.optimize import linprog

from hdl.arithmetic.bands import bands
from hdl.errors import ToolError

GRID = 16  # points along each side of the first grid, and four more for each function along it
TILES = 12  # the frame is searched for violated points in that many tiles a side
EXCHANGES = 40
ABSOLUTE = 1e-6  # precision of the error found, px
ROUNDS = 10  # of least squares, for a lower bound
ROUNDING = 1e-6  # its relative precision


def outside_by(u, v):
    """How far outside the source image a pixel's source lies, px, the greater of both axes; 0 inside."""
    height, width = u.shape
    found = np.zeros_like(u)
    for rows in bands(u.shape):
        for coordinate, last in ((u[rows], width - 1), (v[rows], height - 1)):
            for outside in (-coordinate, coordinate - last):
                np.maximum(found[rows], outside, out=found[rows])
    return found


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
    points = _first_points(allowance, across.shape[1], down.shape[1])
    coefficients = np.zeros((across.shape[1], down.shape[1]))
    for _ in range(EXCHANGES):
        values, bound = _program(*_samples(across, down, terms, target, allowance, points))
        coefficients[tuple(np.transpose(terms))] = values
        if bound > enough:
            return coefficients, bound
        worst, found = _worst_of_tiles(across, down @ coefficients.T, target, allowance)
        if worst <= bound * (1 + precision) + ABSOLUTE:
            break
        points = np.union1d(points, np.array([point for excess, point in found if excess > bound], np.int64))
    return coefficients, worst


def at_least(columns, target):
    """A lower bound of the largest error, px, of columns @ coefficients, whatever these are, at little cost.

    What weighted least squares leave, times its weight, is orthogonal to the columns. The mean of the error, so
    weighted, is therefore the same for all coefficients, and no larger than the largest error. Weights that grow where
    much is left, as in Lawson's method, bring it close to that.
    """
    weight, bound = np.ones(len(target)), 0.0
    for _ in range(ROUNDS):
        root = np.sqrt(weight)
        orthogonal = np.linalg.qr(columns * root[:, None])[0]
        left = target * root
        left -= orthogonal @ (orthogonal.T @ left)
        bound = max(bound, left @ left / max(np.abs(left * root).sum(), np.finfo(float).tiny))
        error = np.abs(left) / root
        weight *= error / error.max(initial=np.finfo(float).tiny) + 0.02
    return (1 - ROUNDING) * float(bound)


def least_error(across, down, terms, target, allowance):
    """A lower bound, px, of the error that `minimax` finds, and of that of its first linear program."""
    points = _first_points(allowance, across.shape[1], down.shape[1])
    points = points[allowance.ravel()[points] == 0]
    return at_least(*_samples(across, down, terms, target, allowance, points)[:2])


def _samples(across, down, terms, target, allowance, points):
    """The products of functions, the target and the allowance at some pixels, given by their flat indices."""
    y, x = np.divmod(points, target.shape[1])
    first, second = np.transpose(terms)
    return across[x][:, first] * down[y][:, second], target[y, x], allowance[y, x]


def _program(columns, target, allowance):
    """Coefficients and the least t with |columns @ coefficients - target| <= t + allowance."""
    ones = np.ones((len(columns), 1))
    result = linprog(
        np.append(np.zeros(columns.shape[1]), 1.0),
        A_ub=np.block([[columns, -ones], [-columns, -ones]]),
        b_ub=np.concatenate([allowance + target, allowance - target]),
        bounds=[(None, None)] * columns.shape[1] + [(0, None)],
        method="highs",
        options={"presolve": False},  # of dense columns it would drop none
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
    grid = (y[:, None] * width + x).ravel()
    if np.isfinite(allowance.max()):
        return np.union1d(grid, np.arange(0, allowance.size, -(-allowance.size // GRID**2)))
    counts = np.isfinite(allowance).ravel()
    some = np.flatnonzero(counts)
    return np.union1d(grid[counts[grid]], some[:: -(-len(some) // GRID**2)])


def _worst_of_tiles(across, down, target, allowance):
    """The largest error beyond the allowance, and the pairs (excess, flat index) of the largest in each tile."""
    height, width = target.shape
    found = []
    excess = np.empty((-(-height // TILES), width))
    for rows in np.array_split(np.arange(height), min(TILES, height)):
        rows = slice(rows[0], rows[-1] + 1)
        band = np.matmul(down[rows], across.T, out=excess[: rows.stop - rows.start])
        band -= target[rows]
        np.abs(band, out=band)
        band -= allowance[rows]
        for columns in np.array_split(np.arange(width), min(TILES, width)):
            tile = band[:, columns[0] : columns[-1] + 1]
            y, x = np.unravel_index(tile.argmax(), tile.shape)
            found.append((float(tile[y, x]), int((rows.start + y) * width + columns[0] + x)))
    return max(found)[0], found
