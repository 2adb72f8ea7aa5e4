"""Everything the report shows about the cores of a folder, measured once; `Report.figures` is the part for machines."""

import base64
import dataclasses
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np

from hdl.calibration.rig import SIDES
from hdl.core.build import Core
from hdl.core.plan_file import PlannedCore, stereo_rig
from hdl.report import figures, stereo
from hdl.tools.synthesis import Resources, netlist, xc7
from hdl.tools.xc7_timing import Path, longest_path
from sim.compiler import compile_core
from sim.frame import Result, frame_through
from sim.images import in_8_bits, read_image
from sim.rows import Rows, Withheld, rows_of_frames
from sim.scene import render

_PICTURE_WIDTH, _PICTURE_QUALITY = 1000, 88  # of a JPEG in the page


@dataclass(frozen=True)
class CameraReport:
    """One camera's core.

    Members
    -------
    planned : PlannedCore
        As it lies in the folder.
    core : Core
        Rebuilt from the plan.
    errors : {"u", "v"}
        `figures.coordinate_errors`.
    peaks : {"u", "v"}
        Their `figures.Largest`.
    needs : (low, high)
        `figures.row_needs`.
    ladder : figures.Ladder
    resources : Resources or None
        Of the whole core, synthesised; None where that was not asked for.
    path : Path or None
        The longest one of that, by the model.
    result : Result
        A frame through the folder's Verilog.
    """

    planned: PlannedCore
    core: Core
    errors: dict
    peaks: dict
    needs: tuple
    ladder: figures.Ladder
    resources: Resources | None
    path: Path | None
    result: Result

    @property
    def plan(self):
        return self.planned.plan


@dataclass(frozen=True)
class Report:
    """The cores of a folder.

    Members
    -------
    cameras : {side: CameraReport}
    clock_mhz : float
    rendered : bool
        Whether the pictures are of the rendered scene.
    rows : sim.rows.Rows, sim.rows.Withheld or None
        Of known points of that scene, or of points found in the user's own pair, or why there is no figure; None for a
        single camera.
    geometry : (float, float, float) or None
        Of a pair: focal length (px), baseline, offset of the principal points (px).
    distances : list of stereo.AtDistance
        Of a pair.
    """

    cameras: dict
    clock_mhz: float
    rendered: bool
    rows: Rows | Withheld | None
    geometry: tuple | None
    distances: list

    @property
    def first(self):
        """The left camera, or the only one."""
        return next(iter(self.cameras.values()))

    @property
    def line(self):
        """What a point of the scene has in common in both rectified pictures: its "row" or its "column"."""
        return self.first.plan.rectification.aligned[:-1]

    @property
    def broken_pixels(self):
        """Pixels that the Verilog gave out unlike the integer model or cv2.remap; 0 unless something is broken."""
        return sum(camera.result.broken for camera in self.cameras.values())

    def figures(self):
        """All numbers behind the page, for JSON. Lengths in px unless named otherwise."""
        return {
            "cameras": {side: self._camera(camera) for side, camera in self.cameras.items()},
            **(
                self.rows.as_dict()
                if self.rows
                else {f"{self.line}_difference": None, f"{self.line}_difference_withheld": None}
            ),
            "stereo": self.geometry
            and {
                "focal_length": self.geometry[0],
                "baseline": self.geometry[1],
                "unit": self.first.plan.rectification.unit,
                "distances": [dataclasses.asdict(entry) for entry in self.distances],
            },
            "versions": figures.versions(),
        }

    def _camera(self, camera):
        low, high = ([None if np.isnan(row) else int(row) for row in rows] for rows in camera.needs)
        return {
            "top": camera.plan.top,
            "plan": camera.plan.model_dump(),
            "largest_error": {axis: dataclasses.asdict(peak) for axis, peak in camera.peaks.items()},
            "line_buffer": {**figures.memory(camera.core), "least_offset": low, "greatest_offset": high},
            "timing": figures.timing(camera.core, self.clock_mhz),
            "budget": camera.ladder.budget,
            "considered": [figures.as_dict(entry) for entry in camera.ladder.entries],
            "coordinate_cost": dataclasses.asdict(camera.core.parameters.datapath.cost),
            "resources": camera.resources and dataclasses.asdict(camera.resources),
            "clock": camera.path and figures.clock(camera.path),
            "pixels_different_from_model": camera.result.model_differences,
            "pixels_different_from_cv2_remap": camera.result.cv2_differences,
            "mean_gray_difference_from_exact_map": camera.result.exact_difference,
            "warnings": figures.warnings(camera.plan),
        }


def measure(planned, *, images, clock_mhz, distances, synthesis, cache, progress=lambda step: None):
    """The `Report` of the cores of a folder.

    Parameters
    ----------
    planned : {side: PlannedCore}
    images : {side: Path}
        The user's own, for each of the cameras; empty: the scene is rendered.
    clock_mhz : float
    distances : list of float or None
        In the calibration's unit; None: `stereo.default_distances`.
    synthesis : bool
        Whether the cores are synthesised.
    cache : Path
        For compiled and synthesised cores.
    progress : callable

    Raises
    ------
    InputError
        For plans that do not rebuild, images that do not fit, and distances that no point of both images has.
    """
    stereo.check_distances(planned, distances)
    plans = {side: one.plan for side, one in planned.items()}
    sources = {
        side: read_image(
            file, (plans[side].width, plans[side].height), plans[side].pixel_bits, plans[side].channels, built=True
        )
        for side, file in images.items()
    }
    cores = {}
    for side, one in planned.items():
        cores[side] = one.rebuild(lambda step, side=side: progress(f"{side} camera: {step}"))
    errors = {side: figures.coordinate_errors(core) for side, core in cores.items()}
    geometry, at = None, []
    if len(cores) == 2:
        views = {side: one.view for side, one in planned.items()}
        geometry = stereo.geometry(*(views[side] for side in SIDES))
        shifts = {side: stereo.displacement(core, errors[side]) for side, core in cores.items()}
        at = stereo.at_distances(views, shifts, distances)
    ladders = {
        side: figures.ladder(
            planned[side], core, lambda step, side=side: progress(f"{side} camera: other datapaths: {step}")
        )
        for side, core in cores.items()
    }
    rig = stereo_rig(planned)
    if not images:
        progress("rendering the scene")
        plan = next(iter(planned.values())).plan
        sources = render(rig, plan.lens, bits=plan.pixel_bits, channels=plan.channels)
    with ThreadPoolExecutor(2) as pool:
        progress("compiling the Verilog for simulation")
        compiled = dict(
            zip(cores, pool.map(lambda one: compile_core(one.verilog, one.plan.top, cache=cache), planned.values()))
        )
        progress("running the frames")
        results = {side: frame_through(core, compiled[side], 0.0, sources[side]) for side, core in cores.items()}
        made = dict.fromkeys(cores, (None, None))
        if synthesis:
            progress("synthesis")
            found = pool.map(
                lambda one: synthesised(one.verilog, one.plan.top, dsp=one.plan.dsp, cache=cache), planned.values()
            )
            made = dict(zip(cores, found))
    found = None
    if len(cores) == 2:
        progress("row differences")
        found = rows_of_frames(results, None if images else rig)
    cameras = {
        side: CameraReport(
            planned[side],
            core,
            errors[side],
            {axis: figures.largest(error) for axis, error in errors[side].items()},
            figures.row_needs(core.parameters.datapath.coordinates, core.parameters.border),
            ladders[side],
            *made[side],
            results[side],
        )
        for side, core in cores.items()
    }
    return Report(cameras, clock_mhz, not images, found, geometry, at)


def synthesised(verilog, top, *, dsp, cache):
    """The `Resources` of a core, and the longest `Path` by the model."""
    found = netlist(verilog, top, xc7(top, dsp), cache=cache)
    return Resources.of(found), longest_path(found)


def jpeg(image, pixel_bits):
    """A frame as a data URI, at most `_PICTURE_WIDTH` px wide."""
    image = in_8_bits(image, pixel_bits)
    height, width = image.shape[:2]
    if width > _PICTURE_WIDTH:
        size = (_PICTURE_WIDTH, round(height * _PICTURE_WIDTH / width))
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _PICTURE_QUALITY])[1]
    return "data:image/jpeg;base64," + base64.b64encode(data.tobytes()).decode()
