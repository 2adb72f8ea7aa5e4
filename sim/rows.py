"""How far apart the rows are on which a pair of images shows one point, before and after rectification.

Points are found in the images as the cameras gave them, and followed through coordinate maps: what an image shows at
the edges of a rectified frame is no part of it, and the same points are compared before and after. They are a
chessboard's corners where both images show one, else features that SIFT matches. A figure is withheld, with the reason,
where the matches do not bear it: a good calibration must not be blamed for what was matched wrongly.

Of cameras that stand one above the other columns are compared instead.
"""

from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np

from hdl.calibration.rig import SIDES
from hdl.core.plan_file import view_of
from hdl.errors import InputError
from sim.alignment import RowDifference, in_px, rectified_positions, row_difference
from sim.boards import chessboard
from sim.images import in_8_bits
from sim.matching import matches
from sim.scene import visible_points

KNOWN_POINTS = 4000
SUSPICIOUS = 1.0  # px, mean; good calibrations leave a quarter of it
LEAST_POINTS = 30
LEAST_AGREEING = 0.5  # share of the matches
EPIPOLAR_TOLERANCE = 1.0  # px
OUTLIER = 5.0  # standard deviations, as the median tells them, and not less than a pixel
BEHIND = -1.0  # px of disparity; points far away have 0
UNMOVED = 0.25  # px
LINES = ("row", "column")  # by the axis along which points are apart


class Withheld(Exception):
    """No figure can be given; ``str()`` says why. Members as those of `Rows`."""

    line = "row"

    def __init__(self, reason, suspicious=False):
        super().__init__(reason)
        self.suspicious = reason if suspicious else None

    def as_dict(self):
        """For JSON."""
        return {f"{self.line}_difference": None, f"{self.line}_difference_withheld": str(self)}

    def sentence(self):
        """In words."""
        return f"How far {self.line}s differ cannot be said: {self}{'' if str(self).endswith('?') else '.'}"


class Points(NamedTuple):
    """Points that both images show: what they are, and where, (n, 2) source px each."""

    kind: str
    left: np.ndarray
    right: np.ndarray


class Rows(NamedTuple):
    """Row differences of the same points.

    Members
    -------
    kind : str
        What the points are.
    line : str
        What is compared: "row", or "column" of cameras that stand one above the other.
    before, after : RowDifference
        In the images as they came, and through the cores' coordinates.
    exact : RowDifference or None
        Through the exact map with the lens, which the calibration alone decides; None for a rendered scene.
    """

    kind: str
    line: str
    before: RowDifference
    after: RowDifference
    exact: RowDifference | None

    @property
    def suspicious(self):
        """What is to be asked where the calibration, not a core, leaves rows apart; else None."""
        if self.exact is None or self.exact.mean <= SUSPICIOUS:
            return None
        return (
            f"{self.line}s of matched points still differ by {self.exact.mean:.1f} px on average; "
            "is the calibration of these cameras, and left the left one?"
        )

    def as_dict(self):
        """For JSON."""
        stages = {"before": self.before, "after": self.after, "exact": self.exact}
        figures = {"points": self.kind, **{name: rows and rows._asdict() for name, rows in stages.items()}}
        return {f"{self.line}_difference": figures, f"{self.line}_difference_withheld": None}

    def sentence(self):
        """In words."""
        what = (
            f"{self.line.capitalize()}s of {self.after.n} {self.kind} differ by {self.before.mean:.2f} px on average "
            f"({most(self.before)}) before, by {self.after.mean:.3f} px ({most(self.after)}) after."
        )
        if self.exact and self.after.mean > self.exact.mean + 0.1:
            what += f" The exact map with the lens leaves {self.exact.mean:.3f} px: the rest is the cores' choice."
        return what


def most(rows):
    """How far apart all but the outliers are, in words."""
    return f"95 % within {rows.percentile_95:.{2 if rows.percentile_95 > 1 else 3}f}"


def rows_of_frames(results, rig=None):
    """The `Rows` of the frames that went through a pair of cores or, where they cannot be told, why: `Withheld`.

    Parameters
    ----------
    results : {side: sim.frame.Result}
    rig : Rig or None
        Whose scene was rendered for them, so that points are known; None: points are looked for.
    """
    maps = {side: in_px(result.core.parameters.datapath.coordinates) for side, result in results.items()}
    views = {side: replace(view_of(result.core.plan), lens=True) for side, result in results.items()}
    bits = results["left"].core.plan.pixel_bits
    try:
        if rig:
            return known(rig, results["left"].core.plan.lens, maps, _along(views))
        return measured({side: in_8_bits(result.source, bits) for side, result in results.items()}, views, maps)
    except Withheld as reason:
        reason.line = LINES[_along(views)]
        return reason


def known(rig, lens, maps, along=0):
    """`Rows` of points of the rendered scene, whose places are known; raises Withheld.

    Parameters
    ----------
    rig, lens
        As for `sim.scene.render`.
    maps : {side: (u, v)}
        The cores' coordinates, px, (height, width).
    along : int
        The axis along which points are apart: 0 for x, 1 for y.
    """
    _, points = visible_points(rig, lens, KNOWN_POINTS)
    try:
        before, after = (row_difference(of, points, f"{LINES[along]}s") for of in (None, maps))
        return Rows("known points of the scene", LINES[along], before, after, None)
    except ValueError as problem:
        raise Withheld(str(problem)) from None


def measured(images, views, maps):
    """`Rows` of points that are found in a pair of images; raises Withheld.

    Parameters
    ----------
    images : {side: (height, width) or (height, width, 3) uint8}
        As the cameras gave them.
    views : {side: View}
        With the lens.
    maps : {side: (u, v)}
        The cores' coordinates, px, (height, width).
    """
    try:
        exact = {side: view.map() for side, view in views.items()}
    except InputError as refusal:  # of the lens, which the cores may have left out
        raise Withheld(str(refusal)) from None
    points = find(images, views)
    left, right = (
        [at, rectified_positions(*maps[side], at), rectified_positions(*exact[side], at)]
        for side, at in zip(SIDES, (points.left, points.right))
    )
    shown = ~np.isnan([left, right]).any(axis=(0, 1, 3))
    if not shown.any():
        raise Withheld(f"of {len(shown)} {points.kind} none is in both rectified images")
    along = _along(views)
    stages = (RowDifference.of((one - other)[shown, 1 - along]) for one, other in zip(left, right))
    return Rows(points.kind, LINES[along], *stages)


def find(images, views):
    """The `Points` of a pair of images, arguments as for `measured`; raises Withheld unless they can be relied on."""
    left, right = (_gray(images[side]) for side in SIDES)
    if np.array_equal(left, right):
        raise Withheld("the two images are the same", suspicious=True)
    positions = [lambda at, view=views[side]: rectified_positions(*view.map(), at) for side in SIDES]
    board = chessboard(left, right, positions)
    if board:
        (columns, rows), *at = board
        kind = f"corners of a {columns}x{rows} chessboard"
    else:
        at, kind = matches(left, right), "points that SIFT matches"
    shown = [place(one) for place, one in zip(positions, at)]
    kept = ~np.isnan(shown).any(axis=(0, 2))
    at, shown = ([pair[kept] for pair in both] for both in (at, shown))
    if not board:
        agreeing = _agreeing(*shown, 1 - _along(views))
        at, shown = ([pair[agreeing] for pair in both] for both in (at, shown))
    _check_sides(*at, *shown, views)
    return Points(kind, *at)


def _along(views):
    """The axis of the baseline, along which points are apart: 0 for x, 1 for y."""
    (one, other) = (views[side].P for side in SIDES)
    x, y = np.abs(one[:2, 3] - other[:2, 3])
    return int(y > x)


def _gray(image):
    return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image


def _agreeing(left, right, across):
    """Which matches agree with one epipolar geometry that is estimated from them alone: it does not know which rows, or
    columns, they should be on. (n, 2) px each, rectified. Raises Withheld where too few do."""
    if len(left) < LEAST_POINTS:
        raise Withheld(f"only {len(left)} points are found in both images; {LEAST_POINTS} are needed")
    _, inliers = cv2.findFundamentalMat(left, right, cv2.USAC_MAGSAC, EPIPOLAR_TOLERANCE, 0.9999, 10000)
    apart = left[:, across] - right[:, across]
    agreeing = np.zeros(len(left), bool) if inliers is None else inliers.ravel() > 0
    if agreeing.any():
        usual = np.median(apart[agreeing])
        deviation = 1.4826 * np.median(np.abs(apart[agreeing] - usual))
        agreeing &= np.abs(apart - usual) <= max(1.0, OUTLIER * deviation)
    if agreeing.sum() < max(LEAST_POINTS, LEAST_AGREEING * len(left)):
        raise Withheld(f"of {len(left)} matches no more than {agreeing.sum()} agree with one another")
    return agreeing


def _check_sides(left, right, shown_left, shown_right, views):
    """Raise Withheld where the two images are the same, or each other's: points then lie behind the cameras."""
    if len(left) and np.mean(np.abs(left - right).max(axis=1) < UNMOVED) > 0.9:
        raise Withheld("the two images show the same from the same place", suspicious=True)
    (one, other) = (views[side].P for side in SIDES)
    axis = _along(views)
    towards = np.sign(one[axis, 3] / one[axis, axis] - other[axis, 3] / other[axis, axis])
    disparity = towards * (shown_left[:, axis] - shown_right[:, axis] - (one[axis, 2] - other[axis, 2]))
    if np.mean(disparity < BEHIND) > 0.5:
        problem = "by the calibration most points lie behind the cameras; are the left and the right image exchanged?"
        raise Withheld(problem, suspicious=True)
