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

_OWN = {"pinhole": 0, "omni": 1, "ds": 2, "eucm": 2}  # how many of the intrinsics are the projection's own
_COUNTS = {"pinhole": (0, 1, 4, 5, 8), "omni": (0, 4), "ds": (0,), "eucm": (0,)}  # of the distortion
_OMNI_DISTORTION = "radtan", "radial-tangential", "plumb_bob", "none"
_KIMERA = "omni_distortion_center"  # beside Kimera's camera_model: omni


def camera(fields: Fields, coefficients: str) -> Camera:
    """The camera in ``fields``, its distortion's coefficients in the field ``coefficients``.

    Raises InputError for a missing field, a wrong count, and a projection or distortion that is not known.
    """
    name = fields.get("camera_model")
    if _KIMERA in fields:
        problem = "Scaramuzza's polynomial from the image to the ray; the inverse polynomial of OCamCalib is needed"
        raise fields.fault("camera_model", name, problem)
    projection = name.lower() if isinstance(name, str) else None
    if projection not in _OWN:
        raise fields.fault("camera_model", name, f"the camera models known are {', '.join(_OWN)}")
    count = _OWN[projection]
    intrinsics = fields.vector("intrinsics", (count + 4,))
    own, (fu, fv, pu, pv) = intrinsics[:count], intrinsics[count:]
    D = fields.vector(coefficients, _COUNTS[projection])
    lens = fields.get("distortion_model")
    if projection == "pinhole":
        model = lenses.model(fields.where, fields.name("distortion_model"), lens, D)
    else:
        if lens not in (_OMNI_DISTORTION if projection == "omni" else ("none",)):
            known = "radtan or none" if projection == "omni" else "none"
            raise fields.fault("distortion_model", lens, f"{projection} is understood with {known}")
        D = np.concatenate([own, D])
        model = lenses.model(fields.where, fields.name("camera_model"), name, D)
    return Camera(model, np.array([[fu, 0, pu], [0, fv, pv], [0, 0, 1]]), D)


def roles(fields: Fields, number: str, coefficients: str) -> dict[str, tuple[str, str]]:
    """Where `camera` finds K and D, for `Rig.fields`; ``number`` is "1" for the left camera, "2" for the right one."""
    holder = coefficients if fields.get("camera_model") == "pinhole" else "intrinsics"
    return {"K" + number: (fields.where, fields.name("intrinsics")), "D" + number: (fields.where, fields.name(holder))}
