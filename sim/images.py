"""Image files as source frames: what is in them, pixel for pixel, or the reason why not."""

import cv2
import numpy as np

from hdl.errors import InputError

# libjpeg fills up with gray what is missing of an image. Some programs write a little behind the end.
_JPEG_START, _JPEG_END, _JPEG_TAIL = b"\xff\xd8", b"\xff\xd9", 4096
_LOG = getattr(cv2.utils, "logging", cv2)  # OpenCV 5, OpenCV 4
_SILENT = 0
_AS_STORED = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_ANYCOLOR | cv2.IMREAD_IGNORE_ORIENTATION


def read_image(file, size, pixel_bits, channels, *, built):
    """An image as a source frame; raises InputError where it is none.

    Gray cores take colour images as gray, colour cores gray ones as colour. Images of 8 bits are scaled up for cores of
    more; 16 bits that hold no more than the core's are taken as they are. Transparency is left out, palettes are looked
    up.

    Parameters
    ----------
    file : Path
    size : (width, height)
        px, of the frames that the core takes.
    pixel_bits, channels : int
    built : bool
        Whether the cores are there already, so that other ones must be generated where these do not fit.

    Returns
    -------
    (height, width) or (height, width, 3), blue, green, red
        uint8 for 8 bits, else uint16.
    """
    image = _decoded(file)
    found = image.shape[1::-1]
    if found != size:
        problem = f"the cores take {size[0]}x{size[1]}"
        if found[0] * size[1] == found[1] * size[0]:
            option = f"--size {found[0]}x{found[1]}"
            problem += f"; generate them with {option}" if built else f"; {option} scales the calibration"
        raise InputError(file, "size", f"{found[0]}x{found[1]}", problem)
    if image.dtype not in (np.uint8, np.uint16):
        raise InputError(file, "pixels", image.dtype, "8 or 16 bits without a sign are needed")
    if image.dtype == np.uint16:
        image = _fitted(file, image, pixel_bits, channels, built)
    elif pixel_bits > 8:
        image = image.astype(np.uint16) << (pixel_bits - 8)
    if channels == 1 and image.ndim == 3:
        return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    return cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if channels == 3 and image.ndim == 2 else image


def in_8_bits(image, pixel_bits):
    """A frame of ``pixel_bits`` as pictures and detectors take it, uint8."""
    return (image >> (pixel_bits - 8)).astype(np.uint8)


def _decoded(file):
    """The pixels as they are stored."""
    data = file.read_bytes()
    if data.startswith(_JPEG_START) and _JPEG_END not in data[-_JPEG_TAIL:]:
        raise InputError(file, None, None, "ends in the middle of the image")
    level = _LOG.setLogLevel(_SILENT)
    try:
        image, turned = (
            cv2.imread(str(file), flags) for flags in (_AS_STORED, _AS_STORED & ~cv2.IMREAD_IGNORE_ORIENTATION)
        )
    except cv2.error as error:
        raise InputError(file, None, None, f"OpenCV refuses this image: {error.err}") from None
    finally:
        _LOG.setLogLevel(level)
    if image is None:
        raise InputError(file, None, None, "is not an image that OpenCV can read")
    if turned is None or turned.shape != image.shape or not np.array_equal(turned, image):
        problem = "is to be turned when it is shown (EXIF), and the sensor's pixels are not; save it without that"
        raise InputError(file, "orientation", None, problem)
    return image


def _fitted(file, image, pixel_bits, channels, built):
    """An image of 16 bits for a core of ``pixel_bits``, which it must not exceed."""
    bits = int(image.max()).bit_length()
    if bits <= pixel_bits:
        return image.astype(np.uint8) if pixel_bits == 8 else image
    problem = f"do not fit {pixel_bits} bits"
    more = next(wide for wide in (8, 10, 12, 16) if wide >= bits)
    if not np.any(image & ((1 << (16 - pixel_bits)) - 1)):
        problem += f", but would, {16 - pixel_bits} bits further down: save it that way"
    elif channels == 1:
        problem += f"; {'generate the cores with ' if built else ''}--pixel-bits {more}" + ("" if built else " does")
    else:
        problem += ", which is what cores of 3 channels have; save it with 8 bits"
    raise InputError(file, "pixels", f"up to {image.max()}", problem)
