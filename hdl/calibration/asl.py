"""A camera as the ASL's programs write it, Kalibr and the dataset format: a projection, and a distortion after it.

``intrinsics`` begin with what the projection has of its own: pinhole fu fv pu pv, omni xi fu fv pu pv, ds xi alpha fu
fv pu pv, eucm alpha beta fu fv pu pv.
Source: Kalibr, aslam_cameras (OmniProjection, DoubleSphereProjection, ExtendedUnifiedProjection, FovDistortion), and
wiki, "Supported models".
"""

import numpy as np

from hdl.calibration import lenses
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Camera

# How many of the intrinsics are the projection's own, and how many coefficients a distortion after it may have.
_PROJECTIONS = {"pinhole": (0, (0, 1, 4, 5, 8)), "omni": (1, (0, 4)), "ds": (2, (0,)), "eucm": (2, (0,))}
_DISTORTIONS = {"omni": ("radtan", "none"), "ds": ("none",), "eucm": ("none",)}  # that of a pinhole is any lens
_KIMERA = "omni_distortion_center"  # beside Kimera's camera_model: omni


def camera(fields: Fields, coefficients: str) -> Camera:
    """The camera in ``fields``, its distortion's coefficients in the field ``coefficients``.

    Raises InputError for a missing field, a wrong count, and a projection or distortion that is not known.
    """
    name = fields.get("camera_model")
    if _KIMERA in fields:
        problem = "Scaramuzza's polynomial from the image to the ray; the inverse polynomial of OCamCalib is needed"
        raise fields.fault("camera_model", name, problem)
    if name not in _PROJECTIONS:
        raise fields.fault("camera_model", name, f"the camera models known are {', '.join(_PROJECTIONS)}")
    own, counts = _PROJECTIONS[name]
    *first, fu, fv, pu, pv = fields.vector("intrinsics", (own + 4,))
    D, distortion = fields.vector(coefficients, counts), fields.get("distortion_model")
    if name == "pinhole":
        model = lenses.model(fields.where, fields.name("distortion_model"), distortion, D)
    elif distortion not in _DISTORTIONS[name]:
        known = " or ".join(_DISTORTIONS[name])
        raise fields.fault("distortion_model", distortion, f"{name} is understood with {known}")
    else:
        D = np.array([*first, *D])
        model = lenses.model(fields.where, fields.name("camera_model"), name, D)
    return Camera(model, np.array([[fu, 0, pu], [0, fv, pv], [0, 0, 1]]), D, size=fields.size("resolution"))


def roles(fields: Fields, number: str, coefficients: str) -> dict[str, tuple[str, str]]:
    """Where `camera` finds size, K and D, for `Rig.fields`; ``number``: "1" for the left camera, "2" for the right."""
    own, counts = _PROJECTIONS[fields.get("camera_model")]
    holders = ["intrinsics"] * (own > 0) + [coefficients] * (max(counts) > 0)
    return {
        "size" + number: (fields.where, fields.name("resolution")),
        "K" + number: (fields.where, fields.name("intrinsics")),
        "D" + number: (fields.where, fields.name(", ".join(holders))),
    }
