"""Errors of source coordinates: of the integer models against a reference, and of the Verilog against the models."""

import os
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np

from hdl.core.build import Options, build
from hdl.datapaths import DATAPATHS
from hdl.errors import InputError
from hdl.geometry.coordinates import Border
from hdl.geometry.rectification import rectify
from sim.alignment import in_px
from sim.beats import to_beats, to_frames
from sim.compiler import compile_core

FRACTION_BITS = Options.fraction_bits
REFERENCE = "conventional"  # what the paper measures against
PIXEL_BITS = 16


def errors(used, reference, counted):
    """Statistics of |used - reference| over the pixels that count.

    Parameters
    ----------
    used, reference : (u, v)
        Source coordinates, px, each (height, width).
    counted : (height, width) bool

    Returns
    -------
    {"real": {"u": {"mean", "max"}, "v": ...}, "rounded": ...}
        px; ``rounded`` is the paper's measure, with each coordinate rounded to whole px, half up, beforehand.
    """
    result = {"real": {}, "rounded": {}}
    for axis, one, other in zip("uv", used, reference):
        one, other = one[counted], other[counted]
        result["real"][axis] = _statistics(np.abs(one - other))
        result["rounded"][axis] = _statistics(np.abs(np.floor(one + 0.5) - np.floor(other + 0.5)))
    return result


def _statistics(magnitude):
    return {"mean": float(magnitude.mean()), "max": float(magnitude.max())}


def turn(view):
    """The rotation of ``view`` about x (pitch), y (yaw) and z (roll), degrees, float64 (3,): its rotation vector."""
    return np.degrees(cv2.Rodrigues(view.R)[0].ravel())


def ramp_core(view, name):
    """The `hdl.core.build.Core` of ``view`` with the datapath ``name``, for pixels that hold a coordinate and borders
    that continue a ramp's end. Raises InputError as `build`."""
    return build(view, Options(name, pixel_bits=PIXEL_BITS, border=Border("replicate")), "ramps")


def verilog_coordinates(core, cache="build/cache"):
    """(u, v), integers of `FRACTION_BITS`, that the exported Verilog of a `ramp_core` uses, by running it.

    Of images that rise by 2**FRACTION_BITS a column and a row a bilinear core gives out its coordinates. Those outside
    the source come out as its edge; at most 2048 px fit the pixels.
    """
    width, height = core.plan.width, core.plan.height
    ramps = np.meshgrid(*(np.arange(size, dtype=np.uint16) << FRACTION_BITS for size in (width, height)))
    compiled = compile_core(core.verilog, core.plan.top, cache=cache)
    stream = compiled.run(to_beats(np.stack(ramps), channels=1, pixel_bits=PIXEL_BITS))
    u, v = to_frames(stream.beats, width, height, pixel_bits=PIXEL_BITS).astype(np.int32)
    return u, v


def unlike(coordinates, u, v):
    """How many pixels of (u, v), from `verilog_coordinates`, are not those of the integer model."""
    right, bottom = ((size - 1) << coordinates.fraction_bits for size in (coordinates.width, coordinates.height))
    different = (u != np.clip(coordinates.u, 0, right)) | (v != np.clip(coordinates.v, 0, bottom))
    return int(np.count_nonzero(different))


def measure(name, rig, *, lenses, datapaths, verilog, progress):
    """Errors of the ``datapaths`` (names) for both cameras of ``rig``.

    Parameters
    ----------
    lenses : of bool
        Without the lens the reference is `REFERENCE`, whose own error is against the exact map; with the lens, for
        datapaths that take it, the exact map.
    verilog : bool
        Run the exported Verilog as well.

    Returns
    -------
    rows : list of dict
        rig, side, datapath, lens, real, rounded (`errors`); reference; width, height, pixels (how many count: those
        whose exact source is inside the image); rotation (degrees, about x, y, z); verilog_unlike (pixels at which the
        Verilog uses other coordinates, None where it was not run).
    refusals : list of str
    """
    rows, refusals, runs = [], [], []
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for lens in lenses:
            for side, view in rectify(rig, lens=lens).items():
                exact, counted, reference = view.map(), view.inside, None
                for datapath in sorted(datapaths, key=lambda datapath: datapath != REFERENCE):
                    if lens and not DATAPATHS[datapath].supports_lens:
                        continue
                    progress(f"{side} camera, {datapath}{', lens' if lens else ''}")
                    try:
                        core = ramp_core(view, datapath) if verilog else None
                        fitted = core.parameters.datapath if core else DATAPATHS[datapath].fit(view, FRACTION_BITS)
                    except InputError as refusal:
                        refusals.append(f"{name}, {side}, {datapath}{', lens' if lens else ''}: {refusal}")
                        if datapath == REFERENCE and not lens:
                            break  # there is nothing to compare with
                        continue
                    used = in_px(fitted.coordinates)
                    is_reference = datapath == REFERENCE and not lens
                    rows.append(
                        {
                            "rig": name,
                            "side": side,
                            "datapath": datapath,
                            "lens": lens,
                            **errors(used, exact if lens or is_reference else reference, counted),
                            "reference": "exact map" if lens or is_reference else REFERENCE,
                            "width": view.width,
                            "height": view.height,
                            "pixels": int(counted.sum()),
                            "rotation": dict(zip("xyz", turn(view).tolist())),
                            "verilog_unlike": None,
                        }
                    )
                    reference = used if is_reference else reference
                    if core:
                        runs.append((rows[-1], fitted, pool.submit(verilog_coordinates, core)))
        progress("running the exported Verilog")
        for row, fitted, run in runs:
            row["verilog_unlike"] = unlike(fitted.coordinates, *run.result())
    return rows, refusals
