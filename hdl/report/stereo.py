"""What the errors of two cores mean for stereo: disparity, depth and row differences at given distances."""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from hdl.core.plan_file import axis_of, baseline_of
from hdl.errors import InputError

# Disparities between which the default distances lie: a share of the width, and px.
_NEAREST, _FARTHEST = 0.25, 2.0


@dataclass(frozen=True)
class AtDistance:
    """Errors at one distance, over all pixels of the left rectified image whose match the right one shows.

    Members
    -------
    distance : float
        In the calibration's unit.
    disparity : float
        px.
    share : float
        Of the left image's pixels: those that are counted.
    disparity_mean, disparity_max : float
        Magnitude of the disparity's error, px.
    depth_mean, depth_max : float
        Magnitude of the depth error that follows, Z^2/(f B) times that of the disparity; in the calibration's unit.
    row_mean, row_max : float
        Magnitude of the difference between the rows of matching points, or the columns where these are aligned, px.
    """

    distance: float
    disparity: float
    share: float
    disparity_mean: float
    disparity_max: float
    depth_mean: float
    depth_max: float
    row_mean: float
    row_max: float


def displacement(core, errors):
    """How far off the rectified image shows what it shows, px: (x, y), each (height, width), NaN where not counted.

    The core reads pixel p at the exact map's source of p + displacement, so that content appears that much too far to
    the left and above. To first order: the inverse Jacobian of the exact map, times the error of the source
    coordinates (`hdl.report.figures.coordinate_errors`).
    """
    u, v = core.exact
    (uy, ux), (vy, vx) = np.gradient(u), np.gradient(v)
    determinant = ux * vy - uy * vx
    return (
        (vy * errors["u"] - uy * errors["v"]) / determinant,
        (ux * errors["v"] - vx * errors["u"]) / determinant,
    )


def geometry(left, right):
    """Focal length (px), baseline (calibration's unit) and offset of the principal points (px), of two `View`s."""
    axis = axis_of(left)
    return left.P[axis, axis], baseline_of(left, right), left.P[axis, 2] - right.P[axis, 2]


def default_distances(focal, baseline, width):
    """1, 2, 5, 10 ... times a power of ten, from disparities of a quarter of the width down to 2 px."""
    nearest, farthest = (focal * baseline / disparity for disparity in (_NEAREST * width, _FARTHEST))
    decades = range(int(np.floor(np.log10(nearest))), int(np.ceil(np.log10(farthest))) + 1)
    found = [digit * 10.0**decade for decade in decades for digit in (1, 2, 5)]
    return [distance for distance in found if nearest <= distance <= farthest]


def check_distances(planned, distances):
    """Raise InputError, before anything is rebuilt, for distances at which the rectified images have nothing in common;
    ``planned``: {side: PlannedCore}."""
    if distances and len(planned) < 2:
        problem = f"depth needs both cameras; there is only the {next(iter(planned))} one"
        raise InputError("--distances", None, None, problem)
    for distance in distances or ():
        _shift({side: one.view for side, one in planned.items()}, distance)


def at_distances(views, displacements, distances):
    """`AtDistance` for each of the ``distances``; ``views`` and ``displacements`` by side.

    Without distances it is `default_distances`, those of them at which points are in both images.

    Raises
    ------
    InputError
        For a distance at which no point is in both images.
    """
    if distances:
        return [_at_distance(views, displacements, distance) for distance in distances]
    found = []
    extent = (views["left"].width, views["left"].height)[axis_of(views["left"])]
    for distance in default_distances(*geometry(views["left"], views["right"])[:2], extent):
        with suppress(InputError):
            found.append(_at_distance(views, displacements, distance))
    return found


def _shift(views, distance):
    """The disparity, px, and how many columns further left the right image shows a point, to the nearest pixel."""
    focal, baseline, offset = geometry(views["left"], views["right"])
    # The right image shows the point this many columns further left (or rows further up), to the nearest pixel.
    disparity, width = focal * baseline / distance, (views["left"].width, views["left"].height)[axis_of(views["left"])]
    shift = round(disparity + offset)
    if abs(shift) >= width:
        problem = f"the disparity there is {disparity:.4g} px, beyond the {width} px of the image"
        raise InputError("--distances", None, f"{distance:g}", problem)
    return disparity, shift


def _at_distance(views, displacements, distance):
    if axis_of(views["left"]):  # down the columns: the same with x and y exchanged
        displacements = {side: (dy.T, dx.T) for side, (dx, dy) in displacements.items()}
    height, width = displacements["left"][0].shape
    focal, baseline, _ = geometry(views["left"], views["right"])
    disparity, shift = _shift(views, distance)
    first, last = max(0, shift), min(width, width + shift)
    columns = {"left": slice(first, last), "right": slice(first - shift, last - shift)}
    dx, dy = (
        np.abs(displacements["left"][axis][:, columns["left"]] - displacements["right"][axis][:, columns["right"]])
        for axis in (0, 1)
    )
    counted = np.isfinite(dx)
    if not counted.any():
        raise InputError("--distances", None, f"{distance:g}", "no point there has its source in both images")
    dx, dy = dx[counted], dy[counted]
    depth = distance**2 / (focal * baseline)
    return AtDistance(
        float(distance),
        float(disparity),
        counted.sum() / (height * width),
        float(dx.mean()),
        float(dx.max()),
        float(dx.mean() * depth),
        float(dx.max() * depth),
        float(dy.mean()),
        float(dy.max()),
    )
