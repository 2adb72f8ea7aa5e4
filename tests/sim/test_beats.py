"""Frames to beats and back."""

import numpy as np
import pytest

from sim.beats import StreamError, to_beats, to_frames


@pytest.mark.parametrize(
    "shape, options, dtype, width",
    [
        ((5, 7), {}, np.uint8, 8),
        ((2, 5, 7), {}, np.uint8, 8),
        ((2, 5, 7), {"pixel_bits": 10}, np.uint16, 10),
        ((5, 7), {"pixel_bits": 12}, np.uint16, 12),
        ((1, 1), {}, np.uint16, 16),
        ((5, 7, 3), {}, np.uint8, 24),
        ((2, 5, 7, 3), {}, np.uint8, 24),
        ((5, 7, 4), {"channels": 4}, np.uint16, 64),
    ],
)
def test_frames_survive_the_way_to_beats_and_back(shape, options, dtype, width):
    channels = options.get("channels", shape[-1] if shape[-1] == 3 else 1)
    bits = options.get("pixel_bits", 8 * dtype().itemsize)
    frames = np.random.default_rng(5).integers(0, 1 << bits, shape).astype(dtype)
    beats = to_beats(frames, **options)
    assert int(beats["data"].max()).bit_length() <= width
    height, width = frames.shape[-3:-1] if channels > 1 else frames.shape[-2:]
    back = to_frames(beats, width, height, channels=channels, pixel_bits=bits)
    assert back.dtype == dtype
    np.testing.assert_array_equal(back, frames.reshape(back.shape))
    assert beats["user"].sum() == len(back) and beats["last"].sum() == len(back) * height


def test_channel_0_is_the_low_byte():
    beats = to_beats(np.array([[[0x11, 0x22, 0x33], [0x44, 0x55, 0x66]]], np.uint8))
    assert beats["data"].tolist() == [0x332211, 0x665544]
    assert beats["user"].tolist() == [True, False]
    assert beats["last"].tolist() == [False, True]


def test_what_is_no_frame_is_refused():
    for frames, options, message in [
        (np.zeros((4, 4)), {}, "frames of float64: not uint8 or uint16"),
        (np.zeros(4, np.uint8), {}, "frames of shape (4,): not (H, W) or (K, H, W), each with 1 channels"),
        (np.zeros((0, 4), np.uint8), {}, "frames of shape (0, 4): not (H, W) or (K, H, W), each with 1 channels"),
        (np.full((2, 2), 1024, np.uint16), {"pixel_bits": 10}, "a sample of 1024 does not fit 10 bits"),
    ]:
        with pytest.raises(ValueError) as error:
            to_beats(frames, **options)
        assert str(error.value) == message


def test_streams_that_are_no_whole_frames_are_refused_where_they_first_differ():
    beats = to_beats(np.zeros((2, 4, 5), np.uint8))
    early = beats.copy()
    early["user"][27] = True
    wide = beats.copy()
    wide["data"][7] = 256
    whole = "does not fit frames of 5x4, 8 bits a pixel"
    for beats_, message in [
        (np.delete(beats, 6), f"frame 0, row 1, column 3: tuser 0, tlast 1, tdata 0x0 {whole}"),
        (np.delete(beats, 20), f"frame 1, row 0, column 0: tuser 0, tlast 0, tdata 0x0 {whole}"),
        (early, f"frame 1, row 1, column 2: tuser 1, tlast 0, tdata 0x0 {whole}"),
        (wide, f"frame 0, row 1, column 2: tuser 0, tlast 0, tdata 0x100 {whole}"),
        (beats[:-1], "39 beats are not whole frames of 5x4"),
        (beats[:0], "0 beats are not whole frames of 5x4"),
    ]:
        with pytest.raises(StreamError) as error:
            to_frames(beats_, 5, 4)
        assert str(error.value) == message
