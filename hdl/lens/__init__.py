"""The lens models by their names; a new one is one file and one entry here."""

from hdl.lens import equidistant, polynomial
from hdl.lens.base import LensModel

__all__ = ["LENS_MODELS", "LensModel"]

LENS_MODELS: dict[str, LensModel] = {model.name: model for file in (polynomial, equidistant) for model in file.MODELS}
