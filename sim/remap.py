"""Integer model of the pixel path: bilinear interpolation at fixed-point source coordinates.

:func:`remap` is written from the definition and knows nothing of OpenCV; :func:`cv2_remap` asks OpenCV for the same
pixels. On 8-bit images with 5 fraction bits the two agree bit for bit.
"""

import cv2
import numpy as np

CV2_FRACTION_BITS = 5  # INTER_BITS, fixed in OpenCV
_CV2_BORDERS = {"constant": cv2.BORDER_CONSTANT, "replicate": cv2.BORDER_REPLICATE}
_CHUNK = 1 << 14  # pixels at a time, so that the temporaries stay in the cache
_MARGIN = 2  # pixels added around the source: a position clipped to them has all its taps outside, as before


def remap(source, u, v, fraction_bits=CV2_FRACTION_BITS, border="constant", border_value=0):
    """The rectified image, as the core computes it.

    Each pixel is ``(sum of tap * weight + half) >> 2*fraction_bits`` over 2x2 taps, with the weights
    ``(2^f - fx)(2^f - fy)``, ``fx (2^f - fy)``, ``(2^f - fx) fy`` and ``fx fy``.

    Parameters
    ----------
    source : (Hs, Ws) or (Hs, Ws, channels) uint8 or uint16
        Unrectified image.
    u, v : (H, W) integer
        Source coordinates in units of 2^-fraction_bits px. Any value, far outside the source too.
    fraction_bits : int
        0 to 8.
    border : "constant" | "replicate"
        What a tap outside the source reads: ``border_value``, or the nearest source pixel. Decided tap by tap.
    border_value : int, or one int per channel
        For ``border="constant"``; within the range of the source's type.

    Returns
    -------
    (H, W) or (H, W, channels), of the source's type

    Raises
    ------
    TypeError, ValueError
        For arguments other than these.

    Source: the fixed-point bilinear rule of cv2.remap, INTER_LINEAR.
    """
    source, u, v = _checked(source, u, v)
    if not 0 <= fraction_bits <= 8:
        raise ValueError(f"fraction_bits = {fraction_bits}: must be 0 to 8")
    height, width = source.shape[:2]
    channels = source.shape[2:]
    stride = width + 2 * _MARGIN
    taps = _padded(source, border, border_value).reshape((-1,) + channels)
    accumulator = np.int32 if 8 * source.itemsize + 2 * fraction_bits < 31 else np.int64
    one = 1 << fraction_bits
    half = one * one >> 1

    result = np.empty((u.size,) + channels, source.dtype)
    flat_u, flat_v = u.reshape(-1), v.reshape(-1)
    for start in range(0, u.size, _CHUNK):
        part = slice(start, start + _CHUNK)
        fx, fy = ((w[part] & (one - 1)).astype(accumulator) for w in (flat_u, flat_v))
        if channels:
            fx, fy = fx[:, None], fy[:, None]
        x = np.clip(flat_u[part] >> fraction_bits, -_MARGIN, width).astype(np.intp)
        y = np.clip(flat_v[part] >> fraction_bits, -_MARGIN, height).astype(np.intp)
        corner = (y + _MARGIN) * stride + (x + _MARGIN)
        total = half + (one - fy) * ((one - fx) * taps[corner] + fx * taps[corner + 1])
        corner += stride
        total += fy * ((one - fx) * taps[corner] + fx * taps[corner + 1])
        result[part] = total >> 2 * fraction_bits
    return result.reshape(u.shape + channels)


def opencv_maps(u, v, fraction_bits=CV2_FRACTION_BITS):
    """The pair of maps that cv2.remap takes for coordinates in units of 2^-5 px.

    Returns
    -------
    (H, W, 2) int16
        Whole pixels, CV_16SC2. Clipped to its range, which no source that cv2.remap accepts reaches.
    (H, W) uint16
        ``fy * 32 + fx``, CV_16UC1.

    Raises
    ------
    ValueError
        When ``fraction_bits`` is not 5: cv2.remap knows no other fixed-point maps.
    """
    if fraction_bits != CV2_FRACTION_BITS:
        raise ValueError(f"fraction_bits = {fraction_bits}: cv2.remap takes {CV2_FRACTION_BITS} only")
    u, v = _checked_coordinates(u, v)
    one = 1 << fraction_bits
    whole = np.stack([u >> fraction_bits, v >> fraction_bits], axis=-1)
    fraction = (v & (one - 1)) * one + (u & (one - 1))
    return np.clip(whole, -(1 << 15), (1 << 15) - 1).astype(np.int16), fraction.astype(np.uint16)


def cv2_remap(source, u, v, border="constant", border_value=0):
    """The same image by cv2.remap, INTER_LINEAR, with fixed-point maps of 5 fraction bits.

    Parameters, result and errors as for :func:`remap`. For uint16 sources OpenCV interpolates in float32, so that
    pixels may differ from the integer rule.
    """
    source, u, v = _checked(source, u, v)
    if border not in _CV2_BORDERS:
        raise ValueError(f"border = {border!r}: must be one of {', '.join(_CV2_BORDERS)}")
    fill = np.broadcast_to(border_value, source.shape[2:] or (1,)).tolist()
    whole, fraction = opencv_maps(u, v)
    return cv2.remap(source, whole, fraction, cv2.INTER_LINEAR, borderMode=_CV2_BORDERS[border], borderValue=fill)


def _checked(source, u, v):
    source = np.asarray(source)
    if source.dtype not in (np.uint8, np.uint16):
        raise TypeError(f"source.dtype = {source.dtype}: must be uint8 or uint16")
    if source.ndim not in (2, 3) or source.size == 0:
        raise ValueError(f"source.shape = {source.shape}: must be (height, width) or (height, width, channels)")
    return source, *_checked_coordinates(u, v)


def _checked_coordinates(u, v):
    u, v = np.asarray(u), np.asarray(v)
    for name, values in (("u", u), ("v", v)):
        if values.dtype.kind not in "iu" or values.dtype == np.uint64:
            raise TypeError(f"{name}.dtype = {values.dtype}: must be an integer that fits int64")
    if u.shape != v.shape or u.ndim != 2:
        raise ValueError(f"u.shape = {u.shape}, v.shape = {v.shape}: must be the same (height, width)")
    # The bounds to clip to need not fit small or unsigned types.
    return u.astype(np.int64, copy=False), v.astype(np.int64, copy=False)


def _padded(source, border, border_value):
    height, width = source.shape[:2]
    if border == "replicate":
        return np.pad(source, [(_MARGIN, _MARGIN)] * 2 + [(0, 0)] * (source.ndim - 2), mode="edge")
    if border != "constant":
        raise ValueError(f"border = {border!r}: must be one of {', '.join(_CV2_BORDERS)}")
    value = np.asarray(border_value)
    if value.dtype.kind not in "iu" or np.any(value < 0) or np.any(value > np.iinfo(source.dtype).max):
        raise ValueError(f"border_value = {border_value}: must be 0 to {np.iinfo(source.dtype).max}")
    padded = np.empty((height + 2 * _MARGIN, width + 2 * _MARGIN) + source.shape[2:], source.dtype)
    padded[...] = value
    padded[_MARGIN:-_MARGIN, _MARGIN:-_MARGIN] = source
    return padded
