"""The lens models by their names; a new one is one file and one entry here."""

from hdl.lens import double_sphere, equidistant, eucm, fov, mei, polynomial, scaramuzza
from hdl.lens.base import LensModel

__all__ = ["LENS_MODELS", "LensModel"]

_FILES = polynomial, equidistant, double_sphere, eucm, mei, fov, scaramuzza

LENS_MODELS: dict[str, LensModel] = {model.name: model for file in _FILES for model in file.MODELS}
