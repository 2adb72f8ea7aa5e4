"""One camera as camodocal writes it, the files that VINS names beside its configuration: model_type and parameters.

Source: camodocal, src/camera_models (PinholeCamera, PinholeFullCamera, EquidistantCamera, CataCamera,
ScaramuzzaCamera), as VINS-Fusion has them in camera_models.
"""

import re

import numpy as np

from hdl.calibration import checks, lenses
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Camera, camera_matrix

_TRAIT = re.compile(r"^model_type[ \t]*:", re.MULTILINE)

_PINHOLE = ("fx", "fy", "cx", "cy")
# Model to our name of the lens, the coefficients in our order, and the names of K's numbers. Some programs write
# KANNALA_BRANDT's coefficients, which count from the cube of the angle as k2, among the distortion_parameters.
_MODELS = {
    "PINHOLE": ("radtan", ("k1", "k2", "p1", "p2"), _PINHOLE),
    "PINHOLE_FULL": ("radtan", ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"), _PINHOLE),
    "KANNALA_BRANDT": ("equidistant", ("k2", "k3", "k4", "k5"), ("mu", "mv", "u0", "v0")),
    "MEI": ("mei", ("xi", "k1", "k2", "p1", "p2"), ("gamma1", "gamma2", "u0", "v0")),
}
_SCARAMUZZA = "SCARAMUZZA"
_GROUPS = ("mirror_parameters", "distortion_parameters", "projection_parameters")


def recognises(document: Document) -> bool:
    return bool(_TRAIT.search(document.text))


def read(document: Document) -> tuple[Camera, tuple[int, int]]:
    """The camera and the size of its images, px. Raises InputError for a missing field and an unknown model."""
    fields = Fields(document.name, document.yaml)
    kind = fields.get("model_type")
    known = kind.upper() if isinstance(kind, str) else None
    if known not in (*_MODELS, _SCARAMUZZA):
        raise fields.fault("model_type", kind, f"the models known are {', '.join((*_MODELS, _SCARAMUZZA))}")
    width, height = (checks.whole(fields.where, key, fields.get(key)) for key in ("image_width", "image_height"))
    size = width, height
    if known == _SCARAMUZZA:
        return _scaramuzza(fields), size
    lens, coefficients, intrinsics = _MODELS[known]
    groups = [fields.child(group) for group in _GROUPS if group in fields]
    D = np.array([_number(fields, groups, name) for name in coefficients])
    K = camera_matrix(*(_number(fields, groups, name) for name in intrinsics))
    return Camera(lenses.model(fields.where, "model_type", lens, D), K, D), size


def _scaramuzza(fields):
    """OCamCalib's inverse polynomial leads from the ray to the image; the other one is not needed."""
    polynomial, affine = fields.child("inv_poly_parameters"), fields.child("affine_parameters")
    terms = sum(key[:1] == "p" and key[1:].isdigit() for key in polynomial)
    inverse = polynomial.numbers(*(f"p{order}" for order in range(max(terms, 2))))
    with np.errstate(all="ignore"):  # what overflows is refused by the checks of every calibration
        return lenses.scaramuzza_camera(inverse, affine.numbers("ac", "ad", "ae"), affine.numbers("cx", "cy"))


def _number(fields, groups, name):
    for group in groups:
        if name in group:
            return group.number(name)
    raise fields.fault(name, None, f"missing in {', '.join(_GROUPS)}")
