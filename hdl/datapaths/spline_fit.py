"""Least-maximum fits of discrete splines, degree 1 across and 2 down, to one coordinate of a map."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solveh_banded

from hdl.arithmetic.bands import banded, bands
from hdl.arithmetic.minimax import at_least

# Columns that a cell must have, so that the words of the next one can be loaded meanwhile.
LEAST_CELL = 6
# Weight of pixels whose source is outside the image: enough to keep the surface from running away there.
OUTSIDE = 1e-5
SAMPLES = 400_000  # of a frame; at most about as many
# Of these, each way in a cell, for a lower bound.
FEW = 5, 8


@dataclass(frozen=True)
class Cells:
    """How a frame is divided.

    Across, cells are ``cell_width`` px and end with the last column. What is left over at the first column is a shorter
    cell, or, if that were shorter than ``LEAST_CELL``, lengthens the first one. A node stands at the column where each
    cell begins (or would, were it of full width), and one after the last column. Down, cells are ``cell_height`` rows
    from row 0; the slope of a node changes every ``slope_rows`` rows.

    Parameters
    ----------
    width, height : int
        Frame, px.
    cell_width, cell_height, slope_rows : int
        Powers of two; slope_rows divides cell_height.
    """

    width: int
    height: int
    cell_width: int
    cell_height: int
    slope_rows: int

    @property
    def columns(self):
        """Cells across."""
        return (self.width + self.offset) // self.cell_width

    @property
    def rows(self):
        """Cells down."""
        return -(-self.height // self.cell_height)

    @property
    def offset(self):
        """Columns by which the first node lies left of the frame; negative where the first cell is lengthened."""
        over = self.width % self.cell_width
        return self.cell_width - over if over >= LEAST_CELL else -over

    @cached_property
    def place(self):
        """Each column's cell and its distance from that cell's first node: two int64 (width,), px."""
        from_first_node = np.arange(self.width) + self.offset
        cell = np.maximum(from_first_node // self.cell_width, 0)
        return cell, from_first_node - cell * self.cell_width

    @property
    def slopes(self):
        """Changes of slope in a cell."""
        return self.cell_height // self.slope_rows

    @property
    def scale(self):
        """What the integer weights of `basis` sum to in each row."""
        return self.cell_height * self.slopes

    @cached_property
    def basis(self):
        """Integer weights of the controls in a node's value, int64 (height, rows + 2), in units of 1/`scale`.

        The discrete quadratic B-spline that the hardware's two accumulators run through: with controls q, the value
        starts at cell_height * ((slopes + 1) q0 + (slopes - 1) q1) / 2 and its slope at slopes * (q1 - q0); each row
        adds the slope to the value, and after every ``slope_rows`` rows q[r] - 2 q[r+1] + q[r+2] is added to the slope,
        r being the cell. Each row depends on three controls.
        """
        return self._run[0]

    @cached_property
    def slope_basis(self):
        """Weights of the controls in a node's slope, likewise."""
        return self._run[1]

    @cached_property
    def _run(self):
        q = np.eye(self.rows + 2, dtype=np.int64)
        slopes, values = np.zeros((2, self.height, self.rows + 2), np.int64)
        # What is added to the slope, then the slope itself; to the value, then the value itself.
        slopes[0] = self.slopes * (q[1] - q[0])
        changes = np.arange(self.slope_rows, self.height, self.slope_rows)
        slopes[changes] = np.diff(q, n=2, axis=0)[(changes - 1) // self.cell_height]
        np.cumsum(slopes, axis=0, out=slopes)
        values[0] = self.cell_height * ((self.slopes + 1) * q[0] + (self.slopes - 1) * q[1]) // 2
        values[1:] = slopes[:-1]
        return np.cumsum(values, axis=0, out=values), slopes


def _samples(cells):
    """The rows and the columns that are looked at."""
    spacing, pixels = 1, cells.width * cells.height
    while pixels > SAMPLES * spacing**2 and 2 * spacing < min(cells.cell_width, cells.slope_rows, 8):
        spacing *= 2
    # The last row and column, too: beyond them nothing holds the surface.
    return (np.unique(np.append(np.arange(0, size, spacing), size - 1)) for size in (cells.height, cells.width))


def least_error(cells, target, inside):
    """A lower bound of the error of a `Fit`, px, at little cost: that of the cells at both sides, where lenses bend
    most."""
    rows, columns = _samples(cells)
    across, down = FEW
    rows = rows[:: max(1, round(cells.cell_height / (rows[1] * down)))]
    bounds = []
    for side in (0, cells.columns - 1):
        x = columns[cells.place[0][columns] == side]
        x = x[np.linspace(0, len(x) - 1, min(across, len(x))).round().astype(int)]
        along = (cells.place[1][x] / cells.cell_width)[:, None]
        basis = (cells.basis[rows] / cells.scale)[:, None]
        counts = inside[np.ix_(rows, x)]
        functions = np.concatenate([basis * (1 - along), basis * along], axis=2)
        bounds.append(at_least(functions[counts], target[np.ix_(rows, x)][counts]))
    return max(bounds)


class Fit:
    """Controls, float64 (columns + 1, rows + 2), of the spline closest to ``target`` in the maximum norm.

    Lawson's method: weighted least squares, the weights multiplied up where the error is large. The normal equations
    are banded, so a step costs little more than reading the samples; of large frames only every few pixels are.

    Parameters
    ----------
    cells : Cells
    target : float64 (height, width)
        Source coordinate, px.
    inside : bool (height, width)
        Pixels that count.

    Members
    -------
    controls
    error : float
        Largest error at the samples, px.
    """

    STEPS = 6

    def __init__(self, cells, target, inside):
        self.cells = cells
        rows, columns = _samples(cells)
        self.basis = cells.basis[rows] / cells.scale
        cell, along = (part[columns] for part in cells.place)
        self.samples = np.bincount(cell)  # of each cell along a row
        self.first = np.cumsum(self.samples) - self.samples  # sample where each cell begins
        self.along = along / cells.cell_width
        self.target = target[np.ix_(rows, columns)]
        counts = inside[np.ix_(rows, columns)]
        outside = None if counts.all() else ~counts
        weight = np.where(counts, 1.0, OUTSIDE)
        self.error, self.controls = np.inf, None
        for _ in range(self.STEPS):
            controls = self._solve(weight)
            # In place: of new arrays that large the memory takes longer than the arithmetic.
            error = self._error(controls)
            if outside is not None:
                error[outside] = 0
            worst = float(error.max())
            if worst < self.error:
                self.error, self.controls = worst, controls
            error /= worst
            error += 0.02
            weight *= error
            if outside is not None:
                weight[outside] = 0
            mean, largest = weight.mean(), weight.max()
            weight /= largest
            if outside is not None:
                weight[outside] = OUTSIDE * mean / largest

    def _error(self, controls):
        """Magnitude of the error at the samples, px."""
        nodes = self.basis @ controls.T
        steps = np.diff(nodes, axis=1)

        def part(rows):
            error = np.repeat(steps[rows], self.samples, axis=1)
            error *= self.along
            error += np.repeat(nodes[rows, :-1], self.samples, axis=1)
            error -= self.target[rows]
            return np.abs(error, out=error)

        return banded(self.target.shape, np.float64, part)

    def _solve(self, weight):
        a, b = 1 - self.along, self.along
        height, n = self.basis.shape
        nodes = self.cells.columns + 1
        same, right_side = np.zeros((height, nodes)), np.zeros((height, nodes))
        next_node = np.empty((height, nodes - 1))

        def in_cells(samples):
            return np.add.reduceat(samples, self.first, axis=1)

        for rows in bands(weight.shape):
            next_node[rows] = in_cells(weight[rows] * (a * b))
            same[rows, :-1] += in_cells(weight[rows] * (a * a))
            same[rows, 1:] += in_cells(weight[rows] * (b * b))
            moment = weight[rows] * self.target[rows]
            right_side[rows, :-1] += in_cells(moment * a)
            right_side[rows, 1:] += in_cells(moment * b)
        # Unknowns in the order node, control: each row of the matrix couples a node with itself and its neighbour, a
        # control with the two on either side.
        diagonals = np.zeros((n + 3, nodes * n))

        def put(products, node_step, control_step):
            first, last = max(0, -control_step), n - max(0, control_step)
            pair = self.basis[:, first:last] * self.basis[:, first + control_step : last + control_step]
            block = products.T @ pair
            row = np.arange(block.shape[0])[:, None] * n + np.arange(first, last)
            distance = node_step * n + control_step
            diagonals[n + 2 - distance, row + distance] = block

        for control_step in range(3):
            put(same, 0, control_step)
        for control_step in range(-2, 3):
            put(next_node, 1, control_step)
        diagonals[-1] += 1e-12 * diagonals[-1].max()
        return solveh_banded(diagonals, (right_side.T @ self.basis).ravel(), overwrite_ab=True).reshape(nodes, n)
