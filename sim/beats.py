"""Frames as the beats of an AXI4-Stream video, and back."""

import numpy as np

# One beat: tdata, tuser (start of frame), tlast (end of line); `gap`, cycles with tvalid low before an input beat;
# `cycle`, filled in by a run: when the beat moved, counted from the last reset.
BEAT = np.dtype([("data", "u8"), ("cycle", "u8"), ("gap", "u4"), ("user", "?"), ("last", "?")], align=True)


class StreamError(RuntimeError):
    """A stream that is not what it should be: a hang, a broken rule of m_axis, beats that are no whole frames."""


def _marked(count: int, height: int, width: int) -> np.ndarray:
    beats = np.zeros((count, height, width), BEAT)
    beats["user"][:, 0, 0] = True
    beats["last"][:, :, -1] = True
    return beats


def to_beats(
    frames: np.ndarray,
    *,
    channels: int | None = None,
    pixel_bits: int | None = None,
    line_gap: int = 0,
    frame_gap: int = 0,
) -> np.ndarray:
    """Frames as a stream, (K*H*W,) BEATs: one pixel a beat, row by row, channel 0 in the low bits.

    Parameters
    ----------
    frames : array or list of arrays
        A frame (H, W) or (H, W, C), or several of one size, (K, H, W) or (K, H, W, C); uint8 or uint16.
    channels : int, optional
        C. Default: 1 for two axes, the last one for four; three axes are one frame if the last is 3, else gray frames.
    pixel_bits : int, optional
        Bits of a channel: where the next channel starts. Default: 8 for uint8, 16 for uint16.
    line_gap, frame_gap : int
        Blanking in cycles before each further line of a frame, and before each further frame.

    Raises
    ------
    ValueError
        If the array has another type or shape, or a sample does not fit pixel_bits.
    """
    frames = np.asarray(frames)
    if frames.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"frames of {frames.dtype}: not uint8 or uint16")
    if channels is None:
        channels = frames.shape[-1] if frames.ndim == 4 or (frames.ndim == 3 and frames.shape[-1] == 3) else 1
    samples = frames if channels > 1 else frames[..., np.newaxis]
    if samples.ndim == 3:
        samples = samples[np.newaxis]
    if samples.ndim != 4 or samples.shape[-1] != channels or not samples.size:
        raise ValueError(f"frames of shape {frames.shape}: not (H, W) or (K, H, W), each with {channels} channels")
    pixel_bits = pixel_bits or 8 * frames.itemsize
    if int(samples.max()) >> pixel_bits:
        raise ValueError(f"a sample of {samples.max()} does not fit {pixel_bits} bits")
    beats = _marked(*samples.shape[:3])
    for channel in range(channels):
        beats["data"] |= samples[..., channel].astype(np.uint64) << np.uint64(channel * pixel_bits)
    beats["gap"][:, 1:, 0] = line_gap
    beats["gap"][1:, 0, 0] = frame_gap
    return beats.ravel()


def to_frames(beats: np.ndarray, width: int, height: int, *, channels: int = 1, pixel_bits: int = 8) -> np.ndarray:
    """The frames in a stream: (K, height, width) or, of several channels, (K, height, width, channels).

    uint8 where pixel_bits is at most 8, else uint16.

    Raises
    ------
    StreamError
        If the stream is not one or more whole frames of that size, tuser on the first pixel of each and tlast on the
        last of each line, or if tdata has bits above the pixel. The message names the first such beat.
    """
    size, bits = width * height, channels * pixel_bits
    marked = _marked(-(-len(beats) // size), height, width).ravel()[: len(beats)]
    # In two steps, since a shift by all 64 bits shifts nothing.
    wide = beats["data"] >> np.uint64(bits - 1) >> np.uint64(1)
    wrong = (beats["user"] != marked["user"]) | (beats["last"] != marked["last"]) | (wide != 0)
    if wrong.any():
        beat = beats[wrong.argmax()]
        line, column = divmod(int(wrong.argmax()), width)
        frame, row = divmod(line, height)
        raise StreamError(
            f"frame {frame}, row {row}, column {column}: tuser {beat['user']:d}, tlast {beat['last']:d}, "
            f"tdata {beat['data']:#x} does not fit frames of {width}x{height}, {bits} bits a pixel"
        )
    if not len(beats) or len(beats) % size:
        raise StreamError(f"{len(beats)} beats are not whole frames of {width}x{height}")
    shifts = np.arange(channels, dtype=np.uint64) * np.uint64(pixel_bits)
    samples = (beats["data"][:, np.newaxis] >> shifts) & np.uint64((1 << pixel_bits) - 1)
    shape = (-1, height, width, channels) if channels > 1 else (-1, height, width)
    return samples.astype(np.uint8 if pixel_bits <= 8 else np.uint16).reshape(shape)
