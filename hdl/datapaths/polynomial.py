"""One polynomial over the whole frame for each coordinate, by forward differences: adders and registers, no memory."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from hdl.arithmetic.bands import bands
from hdl.arithmetic.cost import Cost
from hdl.arithmetic.differences import DifferenceAccumulator, DifferenceForm, functions_along
from hdl.arithmetic.minimax import least_error, minimax, outside_by
from hdl.datapaths.base import Datapath, check_budget, fitted_budget
from hdl.datapaths.proposed import AccumulatedCoordinates
from hdl.errors import BudgetError
from hdl.geometry.coordinates import Coordinates

DEGREES = range(1, 7)
CELLS = (64, 32, 16, 8, 4, 2, 1)
MOST_BITS = 61  # of a value: the model computes in int64
# Share of the distance by which a source lies outside the image that its coordinates may be off beyond the budget, in
# the fit and once rounded: it stays outside.
OUTSIDE, ROUNDED_OUTSIDE = 0.5, 0.8


@dataclass(frozen=True, eq=False)
class Polynomial(Datapath):
    """u and v as bivariate polynomials of the raster position, by forward differences.

    Each has the smallest degree that meets the budget, its coefficients of least maximum error over the pixels whose
    source is inside the image. Degree d takes d*(d + 1)/2 registers and as many adders; degree 1 is `affine`. Without
    a lens degree 2 comes within hundredths of a pixel; lenses take degree 5 and more, at many times a spline's
    flip-flops, so that degrees above 6 are not tried. Latency 0, 1 px/clock.

    118 LUT and 102 FF without the lens, 738 LUT and 804 FF with it (README, the ladder: coordinates of the embedded
    rig, 640x480, 0.05 px).

    Differences along a row change once a cell, those of degree 2 from row to row as well, where the chords fit into the
    budget, since that takes fewer bits.

    Parameters
    ----------
    u_form, v_form : DifferenceForm
        px

    Source: DESIGN section 3; Son and Moon, KSII TIIS 11(6), 2017, accumulate polynomials for the lens.
    """

    name = "polynomial"
    summary = "one polynomial for each coordinate, fitted to the map, by forward differences"
    supports_lens = True

    u_form: DifferenceForm
    v_form: DifferenceForm

    @classmethod
    def fit(cls, view, fraction_bits, max_error=None):
        budget = fitted_budget(fraction_bits) if max_error is None else max_error
        check_budget(budget, fraction_bits)
        exact = view.map()
        allowance = OUTSIDE * outside_by(*exact)
        searches = [_Search(coordinate, allowance, fraction_bits, budget) for coordinate in exact]
        forms = [search.smallest() for search in searches]
        if None in forms:
            reached = max(search.reached for search, form in zip(searches, forms) if form is None)
            who = f"a polynomial of degree up to {DEGREES[-1]} for the {view.side} camera"
            raise BudgetError(budget, reached, who)
        return cls(view.width, view.height, fraction_bits, *forms)

    @cached_property
    def coordinates(self):
        def used(form):
            return lambda rows: form.values(rows) >> (form.fraction_bits - self.fraction_bits)

        return Coordinates.banded(self.shape, self.fraction_bits, used(self.u_form), used(self.v_form))

    @property
    def formats(self):
        return {
            axis if name == "value" else f"{axis}_{name}": q
            for axis, form in (("u", self.u_form), ("v", self.v_form))
            for name, q in form.formats.items()
        }

    @property
    def latency(self):
        return 0

    @property
    def cost(self):
        forms = self.u_form, self.v_form
        bits = sum(form.register_bits for form in forms)
        return Cost(lut=round(0.93 * bits) + 8 * sum(form.cell_height > 1 for form in forms), ff=bits)

    def component(self):
        return AccumulatedCoordinates(self, DifferenceAccumulator)


class _Search:
    """The search of `Polynomial.fit` for one coordinate: the smallest degree, and of it the cells with the fewest bits.

    Parameters
    ----------
    exact : float64 (height, width)
        px
    allowance : float64 (height, width)
        Error beyond the budget that does not matter, px: 0 inside.
    fraction_bits : int
    budget : float
        px

    Members
    -------
    reached : float
        Least error found, px, rounding included.
    """

    PRECISION = 0.01  # of the fit: a hundredth of its error
    COARSE = 16  # rows from one to the next of those that are looked at first

    def __init__(self, exact, allowance, fraction_bits, budget):
        self.exact, self.allowance = exact, allowance
        self.fraction_bits, self.budget = fraction_bits, budget
        self.rounding = 2.0 ** -(fraction_bits + 1)
        self.reached = np.inf

    def smallest(self):
        """A `DifferenceForm` within the budget, or None."""
        hopeless = []
        for degree in DEGREES:
            basis = _basis(self.exact.shape, degree, 1)
            least = basis.least_error(self.exact, self.allowance)
            if least > self.slack:
                hopeless.append((least, degree))
                continue
            coefficients, error = self._closest(degree)
            if error > self.slack:
                continue
            surface, largest = basis.on_grid(coefficients), basis.largest(coefficients)
            # Chords may take half of what is left: with less for the coefficients these would need more bits.
            chords = (self.slack - error) / 2
            best = None
            for cell in CELLS if degree > 1 else (1,):
                # With fewer cells than that some of the functions are none.
                if (min(self.exact.shape) - 1) // cell < degree:
                    continue
                form = self._fewest_bits(_basis(self.exact.shape, degree, cell), surface, largest, chords)
                if form and (not best or form.register_bits < best.register_bits):
                    best = form
                elif best:
                    break
            if best:
                return best
        for least, degree in reversed(hopeless):
            if least + self.rounding < self.reached:
                self._closest(degree)
        return None

    def _closest(self, degree):
        """The coefficients of the closest polynomial and its error, px; one that is beyond the slack is given up."""
        basis = _basis(self.exact.shape, degree, 1)
        coefficients, error = basis.closest(self.exact, self.allowance, self.slack, self.PRECISION)
        if error > self.slack:
            self.reached = min(self.reached, error + self.rounding)
        return coefficients, error

    @property
    def slack(self):
        """What rounding to the output's fraction leaves of the budget, px."""
        return self.budget - self.rounding

    def _fewest_bits(self, basis, surface, largest, chords):
        """The form closest to ``surface`` on the grid, or None where its chords are off by more than ``chords`` px.

        ``largest``: the greatest magnitude over the frame, px.
        """
        lattice = basis.lattice(surface + self.rounding, 1 / (1 + self.allowance[basis.grid] / self.slack))
        if lattice.error > chords:
            return None
        most = MOST_BITS - int(largest).bit_length() - 1
        for bits in range(self.fraction_bits, most):
            coefficients, error = lattice.closest(bits)
            if error > self.budget:
                continue
            form = basis.form(coefficients, bits)
            for step in (self.COARSE, 1):
                error = self._error(form, step)
                if error > self.budget:
                    self.reached = min(self.reached, error)
                    break
            else:
                return form
        return None

    def _error(self, form, step):
        """Largest error beyond what is allowed outside, px, in every ``step``-th row."""
        largest = -np.inf
        for rows in bands(self.exact.shape, step):
            error = (form.values(rows) >> (form.fraction_bits - self.fraction_bits)) * 2.0**-self.fraction_bits
            error -= self.exact[rows]
            np.abs(error, out=error)
            error -= ROUNDED_OUTSIDE / OUTSIDE * self.allowance[rows]
            largest = max(largest, float(error.max()))
        return largest


@lru_cache(maxsize=16)
def _basis(shape, degree, cell):
    return _Basis(shape, degree, cell)


class _Basis:
    """The functions of a `DifferenceForm` of some degree and cells, in float64, and fits by them."""

    GRID = 48  # pixels along each side that coefficients are rounded on

    def __init__(self, shape, degree, cell):
        self.shape, self.degree, self.cell_width = shape, degree, cell
        self.cell_height = cell if degree == 2 else 1
        height, width = shape
        self.across = np.array(functions_along(width, degree, self.cell_width), dtype=np.float64)
        self.down = np.array(functions_along(height, degree, self.cell_height), dtype=np.float64)
        # By degree: the lattice is rounded from the last one on.
        self.terms = sorted(
            ((across, down) for across in range(degree + 1) for down in range(degree + 1 - across)), key=sum
        )

    @cached_property
    def _orthogonal(self):
        return [_orthogonal(functions) for functions in (self.across, self.down)]

    def closest(self, target, allowance, enough, precision):
        """`minimax` by these functions: coefficients of orthogonal ones, and the error, px."""
        return minimax(*self._orthogonal, self.terms, target, allowance, enough, precision)

    def least_error(self, target, allowance):
        """`least_error` by these functions, px."""
        return least_error(*self._orthogonal, self.terms, target, allowance)

    @cached_property
    def grid(self):
        """Index of the pixels that coefficients are rounded on."""
        return np.ix_(*(np.unique(np.linspace(0, size - 1, self.GRID).round().astype(np.int64)) for size in self.shape))

    def on_grid(self, coefficients):
        """What `closest` found, px, at the pixels of the `grid`."""
        y, x = (index.ravel() for index in self.grid)
        across, down = self._orthogonal
        return down[y] @ coefficients.T @ across[x].T

    def largest(self, coefficients):
        """The greatest magnitude of what `closest` found, px, at any pixel."""
        across, down = self._orthogonal
        return max(np.abs(down[rows] @ coefficients.T @ across.T).max() for rows in bands(self.shape))

    def lattice(self, target, weight):
        """A `_Lattice` for ``target`` on the `grid`, with these weights."""
        y, x = (index.ravel() for index in self.grid)
        down, across = self.down[y], self.across[x]
        columns = np.stack([np.outer(down[:, j], across[:, k]).ravel() for k, j in self.terms], axis=1)
        finer = [self.cell_height if term == (1, 1) else 1 for term in self.terms]
        return _Lattice(columns / finer, target.ravel(), weight.ravel())

    def form(self, coefficients, bits):
        matrix = np.zeros((self.degree + 1, self.degree + 1), np.int64)
        for term, coefficient in zip(self.terms, coefficients):
            matrix[term] = coefficient
        height, width = self.shape
        return DifferenceForm(matrix, self.cell_width, self.cell_height, bits, width, height)


class _Lattice:
    """Integer coefficients for functions that are far from orthogonal.

    What rounding the last coefficient costs is made up for by the ones before it as far as these can, and so on down to
    the first: the nearest plane algorithm of Babai (Combinatorica 6, 1986).

    Parameters
    ----------
    columns : float64 (samples, functions)
    target, weight : float64 (samples,)
        px; 0 to 1

    Members
    -------
    error : float
        Largest weighted error with real coefficients, px.
    """

    def __init__(self, columns, target, weight):
        self.columns, self.target, self.weight = columns, target, weight
        self.scale = np.abs(columns).max(axis=0)
        orthogonal, self.triangle = np.linalg.qr(columns / self.scale * weight[:, None])
        self.moments = orthogonal.T @ (target * weight)
        self.error = float(np.abs(orthogonal @ self.moments - target * weight).max())

    def closest(self, bits):
        """Coefficients in units of 2**-bits, Python integers, and their largest weighted error, px."""
        unit = 2.0**-bits * self.scale
        rounded = np.zeros(len(unit))
        for k in reversed(range(len(unit))):
            remaining = self.moments[k] - self.triangle[k, k + 1 :] @ (rounded * unit)[k + 1 :]
            rounded[k] = np.round(remaining / self.triangle[k, k] / unit[k])
        error = np.abs(self.columns @ (rounded * 2.0**-bits) - self.target) * self.weight
        return [int(value) for value in rounded], float(error.max())


def _orthogonal(functions):
    """Orthogonal functions of the order of 1 with the same span, degree by degree."""
    return np.linalg.qr(functions / np.abs(functions).max(axis=0))[0] * np.sqrt(len(functions))
