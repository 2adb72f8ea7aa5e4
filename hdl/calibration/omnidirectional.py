"""Omnidirectional lenses in files of formats that are not read otherwise: camodocal's (VINS) and Basalt's."""

import re

from hdl.calibration import lenses
from hdl.calibration.documents import Document

_TRAIT = re.compile(r'^[ \t]*"?(model_type|camera_type|camera_model)"?[ \t]*:[ \t]*"?(\w+)', re.MULTILINE)


def refuse(document: Document) -> None:
    """Raises InputError if ``document`` names an omnidirectional lens as the model of a camera."""
    for match in _TRAIT.finditer(document.text):
        lenses.refuse_omnidirectional(document.name, *match.groups())
