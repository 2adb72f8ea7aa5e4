"""img.params of the MYNT EYE S SDK: one or more resolutions, each pinhole or equidistant.

Despite its name, ``ex_right_to_left`` is what the SDK hands to cv2.stereoRectify as it stands: x_right = R x_left + T,
with T in millimetres; the SDK's specification calls it the transformation from left image to right image.
Source: MYNT-EYE-S-SDK, samples/config, src/mynteye/api/processor/rectify_processor.cc and docs, "Image params".
"""

import re

import numpy as np

from hdl.calibration import checks
from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Camera, Rig, polynomial_model
from hdl.calibration.selection import one
from hdl.calibration.suspicions import FARTHEST_CENTRE
from hdl.errors import InputError

NAME = "mynt"
TITLE = "MYNT EYE img.params (YAML)"
SEVERAL_FILES = False
SELECT = "a resolution, as in 640x400"

_TRAIT = re.compile(r"^img_params[ \t]*:", re.MULTILINE)
_PINHOLE, _EQUIDISTANT = 0, 1


def recognises(document: Document) -> bool:
    return bool(_TRAIT.search(document.text))


def read(documents: list[Document], size: tuple[int, int] | None, select: str | None) -> Rig:
    """The rig in one document at the resolution ``select``, otherwise at ``size`` (px) if there is one of it, otherwise
    at the first one, with a warning if there are more.

    Raises InputError for a missing field, an unknown model, and a camera copied from another resolution.
    """
    (document,) = documents
    whole = Fields(document.name, document.yaml)
    blocks = _blocks(whole)
    name = one(select, list(blocks)) if select is not None else f"{size[0]}x{size[1]}" if size else None
    chosen = name if name in blocks else next(iter(blocks))
    block = blocks[chosen]
    width, height = _size(block)
    left, right = (_camera(block, side) for side in ("in_left", "in_right"))
    _refuse_copies(blocks, block, {"in_left": left, "in_right": right})
    motion = block.child("ex_right_to_left")
    R = motion.matrix("rotation", 3, 3)
    T = checks.position(motion.where, motion.name("translation"), motion.matrix("translation", 3)) / 1000
    fields = {"size": (document.name, block.name("width, height"))}
    for number, side in (("1", "in_left"), ("2", "in_right")):
        fields |= {role + number: (document.name, block.name(side)) for role in "KD"}
    fields["R"] = document.name, motion.name("rotation")
    fields["T"] = document.name, motion.name("translation")
    rig = Rig(document.name, width, height, left, right, R, T, unit="m", fields=fields)
    if chosen != name and len(blocks) > 1:
        problem = f"the first of {', '.join(blocks)}; choose another with --select or --size"
        rig = rig.warned("size", chosen, problem)
    return rig


def _blocks(whole):
    """Resolution, as WIDTHxHEIGHT, to the entries for it."""
    content = whole.get("img_params")
    if not isinstance(content, list) or not content:
        raise whole.fault("img_params", content, "a list of resolutions is needed")
    blocks = {}
    for index, entry in enumerate(content):
        block = Fields(whole.where, entry, f"img_params[{index}]")
        width, height = _size(block)
        if blocks.setdefault(f"{width}x{height}", block) is not block:
            raise block.fault("width, height", f"{width}x{height}", "given twice")
    return blocks


def _size(block):
    return checks.image_size(block.where, block.name("width, height"), block.get("width"), block.get("height"))


def _camera(block, side):
    fields, model = block.child(side), block.get("model")
    if model == _PINHOLE:
        D = fields.vector("coeffs", (5,))
        fx, fy, cx, cy = (fields.number(key) for key in ("fx", "fy", "cx", "cy"))
        lens = polynomial_model(D)
    elif model == _EQUIDISTANT:
        *D, fx, fy, cx, cy = fields.vector("coeffs", (8,))
        D, lens = np.array(D), "equidistant"
    else:
        raise block.fault("model", model, "0 (pinhole) or 1 (equidistant) is needed")
    return Camera(lens, np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), D)


def _refuse_copies(blocks, block, cameras):
    """The SDK's template keeps the numbers of one resolution for all others until they are calibrated."""
    size = _size(block)
    for side, camera in cameras.items():
        centre = camera.K[:2, 2]
        off = np.abs(centre - (np.array(size) - 1) / 2) / size
        for other in blocks.values():
            if other is block or off.max() <= FARTHEST_CENTRE:
                continue
            if np.array_equal(_camera(other, side).K, camera.K):
                problem = f"copied: the same numbers stand for {'x'.join(map(str, _size(other)))}, and do not fit here"
                value = f"centre {centre[0]:.6g}, {centre[1]:.6g} of {size[0]}x{size[1]}"
                raise InputError(block.where, block.name(side), value, problem)
