"""Two images side by side under common horizontal lines: what is in one row of both is rectified. Or one above the
other, under common vertical ones, where columns are."""

import cv2
import numpy as np

_LINE = (0, 159, 230)  # blue, green, red: orange, of the palette by Okabe and Ito; neither gray nor lost to anyone
_PAPER, _TEXT = (255, 255, 255), (40, 40, 40)
_FONT = cv2.FONT_HERSHEY_SIMPLEX


def column_overlay(left, right, lines=16):
    """As `epipolar_overlay`, for images with columns in common: left above right, under lines that run downwards.

    Returns (2 H + gap, W, 3) uint8.
    """
    return epipolar_overlay(*(np.swapaxes(image, 0, 1) for image in (left, right)), lines).swapaxes(0, 1)


def epipolar_overlay(left, right, lines=16, captions=None):
    """Left image, gap, right image, and lines across all of it.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Gray, or blue, green, red; of one height.
    lines : int or sequence of int
        How many, evenly spaced, or in which rows.
    captions : (str, str) or None
        Written above the images, on white.

    Returns
    -------
    (H + caption, 2 W + gap, 3) uint8
        Blue, green, red, as cv2.imwrite takes it.

    Raises
    ------
    ValueError
        For other images, and for lines outside of them.
    """
    left, right = _colour("left", left), _colour("right", right)
    height = left.shape[0]
    if right.shape[0] != height:
        raise ValueError(f"right.shape = {right.shape}: must be {height} rows high, as the left image")
    rows = np.round((np.arange(lines) + 0.5) * height / lines - 0.5) if np.isscalar(lines) else np.asarray(lines)
    if rows.size and not 0 <= rows.min() <= rows.max() < height:
        raise ValueError(f"lines = {lines}: must be rows 0 to {height - 1}")
    thickness = max(1, round(height / 720))
    gap = np.full((height, max(4, left.shape[1] // 80), 3), _PAPER, np.uint8)
    picture = np.hstack([left, gap, right])
    for row in rows.astype(int):
        first = max(0, row - thickness // 2)
        picture[first : first + thickness] = _LINE
    if not captions:
        return picture
    scale = max(0.5, height / 900)
    strip = np.full((int(40 * scale), picture.shape[1], 3), _PAPER, np.uint8)
    for text, x in zip(captions, (0, left.shape[1] + gap.shape[1])):
        cv2.putText(strip, text, (x + 2, int(27 * scale)), _FONT, scale, _TEXT, thickness, cv2.LINE_AA)
    return np.vstack([strip, picture])


def _colour(name, image):
    image = np.asarray(image)
    if image.dtype != np.uint8 or image.ndim not in (2, 3) or image.ndim == 3 and image.shape[2] != 3:
        raise ValueError(f"{name}: {image.dtype} {image.shape}: must be uint8, (height, width) or (height, width, 3)")
    return image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
