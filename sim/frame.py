"""One frame through the Verilog of one core, and how its pixels compare."""

import time
from dataclasses import dataclass

import cv2
import numpy as np

from sim.beats import to_beats, to_frames
from sim.remap import CV2_FRACTION_BITS, cv2_remap, remap


@dataclass(frozen=True)
class Result:
    """One camera's frame through its core.

    Members
    -------
    core : hdl.core.build.Core
    source, rectified : (H, W) or (H, W, 3)
        What went in and what the hardware gave out.
    model_differences : int
        Pixels that differ from the integer model's; 0 unless something is broken.
    cv2_differences : int or None
        Pixels that differ from cv2.remap's with the same fixed-point coordinates; None where OpenCV has no such
        arithmetic (pixels of more than 8 bits, other than 5 fraction bits).
    exact_difference : float
        Mean gray-level difference from the map in float64, in steps of the pixel's own scale.
    seconds, cycles, compile_seconds
        The frame's run, and making the simulator.
    """

    core: object
    source: np.ndarray
    rectified: np.ndarray
    model_differences: int
    cv2_differences: int | None
    exact_difference: float
    seconds: float
    cycles: int
    compile_seconds: float

    @property
    def broken(self):
        """Pixels unlike the model's or cv2.remap's; 0 unless something is broken."""
        return self.model_differences + (self.cv2_differences or 0)


def frame_through(core, compiled, compile_seconds, source):
    """Run one frame through a compiled core and compare; returns a `Result`."""
    plan, coordinates = core.plan, core.parameters.datapath.coordinates
    start = time.perf_counter()
    stream = compiled.run(to_beats(source, channels=plan.channels, pixel_bits=plan.pixel_bits))
    (rectified,) = to_frames(stream.beats, plan.width, plan.height, channels=plan.channels, pixel_bits=plan.pixel_bits)
    seconds = time.perf_counter() - start
    border = (plan.border.mode, plan.border.value)
    model = remap(source, coordinates.u, coordinates.v, plan.fraction_bits, *border)
    same_in_cv2 = source.dtype == np.uint8 and plan.fraction_bits == CV2_FRACTION_BITS
    cv2_pixels = cv2_remap(source, coordinates.u, coordinates.v, *border) if same_in_cv2 else None
    exact = cv2.remap(
        source,
        *(axis.astype(np.float32) for axis in core.exact),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE if border[0] == "replicate" else cv2.BORDER_CONSTANT,
        borderValue=[border[1]] * 3,
    )
    return Result(
        core,
        source,
        rectified,
        _different_pixels(rectified, model),
        None if cv2_pixels is None else _different_pixels(rectified, cv2_pixels),
        float(np.abs(rectified.astype(float) - exact).mean()),
        seconds,
        stream.cycles,
        compile_seconds,
    )


def _different_pixels(a, b):
    different = a != b
    return int(np.count_nonzero(different.any(axis=-1) if different.ndim == 3 else different))
