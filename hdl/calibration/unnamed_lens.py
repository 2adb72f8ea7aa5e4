"""Lenses that a file gives the coefficients of and no name for.

Four coefficients are k1, k2, p1 and p2 of OpenCV's polynomial model, or k1 to k4 of cv::fisheye. A reader of files that
may leave open which makes its cameras with :func:`camera`; ``load`` then has them settled here, by the option
--lens-model or by a guess, which is said. Any other count leaves the polynomial model only.
"""

from dataclasses import replace

import cv2
import numpy as np

from hdl.calibration.rig import SIDES, Camera, Rig, polynomial_model
from hdl.errors import InputError
from hdl.lens import LENS_MODELS
from hdl.lens.polynomial import MODELS as POLYNOMIAL

# How many coefficients a lens without a name may have, of some model; checks.check refuses what no option makes one of.
COUNTS = tuple(sorted({count for model in LENS_MODELS.values() for count in model.counts}))

_POLYNOMIAL = [model.name for model in POLYNOMIAL]  # ever more terms in use
_MEANING = {"radtan": "k1, k2, p1, p2", "equidistant": "k1 to k4 of cv::fisheye"}

# cv2.stereoRectify and cv2.fisheye.stereoRectify put the principal point elsewhere. The one within CENTRE_NEAR px of
# the file's made it, unless the other comes as near as CENTRE_TELLS times as far.
CENTRE_NEAR, CENTRE_TELLS = 2.0, 3.0

# Of lenses of public calibrations, as far as they tell the two models apart.
LARGEST_TANGENTIAL = 0.02  # p1, p2
LEAST_FISHEYE = 1e-3  # the larger one of k3 and k4
FISHEYE_RATIO = 1 / 20, 2.0  # of k4 to k3, which have opposite signs
ORTHOGRAPHIC = -1 / 6  # k1 of sin(theta); no lens bends more
WIDE, OUTWARDS = 1.0, 1.05  # from this radius on the normalised plane on, lenses do not magnify outwards by so much
WIDEST_ANGLE, WIDEST_PLANE = 2.0, 4.0  # rad from the axis, and radius on the normalised plane, that are looked at


def camera(K: np.ndarray, D: np.ndarray) -> Camera:
    """A camera whose lens the file has no name for; D.size in COUNTS."""
    return Camera(polynomial_model(D[:14]), K, D, named=False)


def chosen(rig: Rig, name: str | None) -> Rig:
    """``rig`` with both lenses of the model ``name``, which the option --lens-model gives; ``rig`` itself for None.

    Raises InputError where the file names another model, and where the coefficients are not those of such a lens.
    """
    if name is None:
        return rig
    if name not in LENS_MODELS:
        raise InputError("--lens-model", None, name, f"the lens models known are {', '.join(LENS_MODELS)}")
    left, right = (_of_model(rig, side, name) for side in SIDES)
    return replace(rig, left=left, right=right)


def _of_model(rig, side, name):
    def refusal(problem):
        where, field = rig.fields.get(_role("D", side), (rig.source, _role("D", side)))
        return InputError("--lens-model", None, name, f"{where}: {field} {problem}")

    camera, counts = rig.camera(side), LENS_MODELS[name].counts
    if camera.named and camera.model != name and not {camera.model, name} <= set(_POLYNOMIAL):
        raise refusal(f"is of a lens that the file calls {camera.model}")
    if camera.D.size not in counts:
        raise refusal(f"has {camera.D.size} coefficients, and such a lens {' or '.join(map(str, counts))}")
    if name in _POLYNOMIAL:
        needed = polynomial_model(camera.D)
        if _POLYNOMIAL.index(needed) > _POLYNOMIAL.index(name):
            raise refusal(f"has coefficients of {needed}")
        name = needed
    return replace(camera, model=name, named=True)


def guessed(rig: Rig) -> Rig:
    """``rig``, which has passed checks.check, with a guess at lenses without a name and a warning of what was taken.

    Only four coefficients are doubtful. Other counts are warned of where ``rig.fields`` has a role "model1" or "model2"
    for an entry that should have named the lens.
    """
    unnamed = [side for side in SIDES if not rig.camera(side).named]
    if doubtful := [side for side in unnamed if rig.camera(side).D.size == 4]:
        model, reason = _guess(rig, doubtful)
        other = "radtan" if model == "equidistant" else "equidistant"
        problem = (
            f"four coefficients and no name of the lens: taken for {model} ({_MEANING[model]}), as {reason}; "
            f"--lens-model {other} if they are {_MEANING[other]}"
        )
        rig = replace(rig, **{side: replace(rig.camera(side), model=model) for side in doubtful})
        return rig.warned(_role("D", doubtful[0]), rig.camera(doubtful[0]).D, problem)
    for side in unnamed:
        if _role("model", side) in rig.fields:
            camera = rig.camera(side)
            problem = (
                f"missing: taken for {camera.model} (plumb_bob and its extensions) by its {camera.D.size} "
                "coefficients; --lens-model settles it"
            )
            return rig.warned(_role("model", side), None, problem)
    return rig


def _role(field, side):
    return f"{field}{1 + SIDES.index(side)}"


def _guess(rig, doubtful):
    """The model, and why, of the cameras of the sides ``doubtful``."""
    for side in set(SIDES) - set(doubtful):
        model = "equidistant" if rig.camera(side).model == "equidistant" else "radtan"
        return model, f"the lens of the {side} camera is one"
    cameras = rig.left, rig.right
    with np.errstate(all="ignore"):
        return _by_rectification(rig) or _by_numbers([camera.D for camera in cameras], list(map(_reach, cameras)))


def _by_rectification(rig):
    """The lens for which OpenCV makes the rectification that the file carries, or None if that does not tell."""
    if not rig.rectification:
        return None
    (_, P1), (_, P2) = rig.rectification.values()
    centres = np.array([P1[:2, 2], P2[:2, 2]])
    flags = cv2.CALIB_ZERO_DISPARITY if np.array_equal(*centres) else 0
    cameras = [part for camera in (rig.left, rig.right) for part in (camera.K, camera.D)]
    setting = *cameras, (rig.width, rig.height), rig.R, rig.T.reshape(3, 1)
    off = {
        "radtan": lambda: cv2.stereoRectify(*setting, flags=flags, alpha=0)[2:4],
        "equidistant": lambda: _fisheye(setting, flags, P1[1, 1]),
    }
    for model, rectify in off.items():
        try:
            made = np.array([P[:2, 2] for P in rectify()])
        except cv2.error:
            made = np.full((2, 2), np.inf)
        off[model] = np.nan_to_num(np.abs(made - centres).max(), nan=np.inf)
    (near, model), (far, _) = sorted((distance, model) for model, distance in off.items())
    if near > CENTRE_NEAR or far < CENTRE_TELLS * near:
        return None
    name = "cv2.fisheye.stereoRectify" if model == "equidistant" else "cv2.stereoRectify"
    return model, f"P1 and P2 are those of {name}"


def _fisheye(setting, flags, focal):
    """P1, P2 of cv2.fisheye.stereoRectify with the focal length ``focal``, which decides on the principal point too."""
    P1 = cv2.fisheye.stereoRectify(*setting, flags=flags)[2]
    return cv2.fisheye.stereoRectify(*setting, flags=flags, fov_scale=P1[1, 1] / focal)[2:4]


def _by_numbers(D, reach):
    """The lens that the coefficients of both cameras make sensible.

    Parameters
    ----------
    D : list of (4,) float64
    reach : list of float
        Of each camera, the farthest of its image's edges from the centre, on the normalised plane.
    """
    k1, k2, third, fourth = np.transpose(D)
    largest = np.abs([third, fourth]).max(axis=0)
    ratio = -fourth / np.where(third, third, np.inf)
    least, most = FISHEYE_RATIO
    if not largest.any():
        return "radtan", "p1 and p2 are often zero, and k3 and k4 are not"
    if largest.max() > LARGEST_TANGENTIAL:
        return "equidistant", "p1 and p2 of a lens are thousandths"
    if not all(_rises_to(radius, _fisheye_curve(d)) for d, radius in zip(D, reach)):
        return "radtan", "an equidistant lens with these coefficients would fold its image back"
    if k1.mean() < ORTHOGRAPHIC:
        return "radtan", "no fisheye has so small a k1"
    if not all(_rises_to(radius, _polynomial_curve(d)) for d, radius in zip(D, reach)):
        return "equidistant", "a radtan lens with these coefficients would fold its image back"
    if min(reach) > WIDE and (1 + k1 * np.square(reach) + k2 * np.power(reach, 4)).min() > OUTWARDS:
        return "equidistant", "a radtan lens of so wide a view does not magnify outwards"
    if largest.max() >= LEAST_FISHEYE and ((least <= ratio) & (ratio <= most)).all():
        return "equidistant", "the last two have opposite signs in both cameras, as k3 and k4 do"
    return "radtan", "the last two are thousandths, as p1 and p2 are"


def _reach(camera):
    (fx, _, cx), (_, fy, cy), _ = camera.K
    width, height = camera.size
    return max(cx / fx, (width - 1 - cx) / fx, cy / fy, (height - 1 - cy) / fy)


def _fisheye_curve(D):
    theta = np.linspace(0, WIDEST_ANGLE, 400)
    return theta * np.polyval([*D[::-1], 1], theta * theta)


def _polynomial_curve(D):
    radius = np.linspace(0, WIDEST_PLANE, 400)
    return radius * np.polyval([D[1], D[0], 1], radius * radius)


def _rises_to(radius, curve):
    """Whether ``curve``, sampled from 0 on, rises without a turn until it reaches ``radius``."""
    reached = np.argmax(curve >= radius)
    return bool(reached and (np.diff(curve[: reached + 1]) > 0).all())
