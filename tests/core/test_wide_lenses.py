"""Whole cores for the lens models that OpenCV does not have, as exact as others, their Verilog run."""

from functools import cache

import numpy as np
import pytest
from calibration_files import turn
from format_files import RIGS
from rig_numbers import OCAM

from hdl import files
from hdl.calibration import Rig, lenses, load
from hdl.core.build import Options, build
from hdl.core.plan_file import load_folder
from hdl.datapaths import DATAPATHS
from hdl.datapaths.selection import choose
from hdl.errors import InputError
from hdl.geometry.rectification import RectificationOptions, rectify
from sim import reference
from sim.beats import to_beats, to_frames
from sim.compiler import compile_core
from sim.remap import cv2_remap

SIZE = 160, 120
# Views as wide as a frame so small can hold; None: as wide as the source's focal length makes them.
FOV = {"tum_vi_ds": 80, "euroc_eucm": None, "kalibr_omni": None, "mynteye_fov": None, "ocam": 80}
MODELS = {"tum_vi_ds": "double_sphere", "euroc_eucm": "eucm", "kalibr_omni": "mei", "mynteye_fov": "fov",
          "ocam": "scaramuzza"}  # fmt: skip


@pytest.fixture(scope="module")
def view(tmp_path_factory):
    """The left view of the rig called ``name``, with the lens."""

    @cache
    def of(name):
        if name == "ocam":
            camera = lenses.scaramuzza_camera(OCAM["inverse"], OCAM["affine"], OCAM["centre"])
            R, T = turn(0.01, -0.02, 0.015), np.array([-0.1, 0.001, 0.002])
            rig = Rig("ocam", *OCAM["size"], camera, camera, R, T).scaled(*SIZE)
        else:
            rig = load(*RIGS[name].write(tmp_path_factory.mktemp(name)), size=SIZE)
        return rectify(rig, RectificationOptions(fov=FOV[name]), lens=True)["left"]

    return of


@cache
def core(view):
    return build(view, Options("spline", max_error=0.05), "rectify")


@pytest.mark.parametrize("name", FOV)
def test_a_spline_is_within_its_budget_of_the_papers_equations(name, view):
    coordinates = core(view(name)).parameters.datapath.coordinates
    inside = view(name).inside
    assert view(name).camera.model == MODELS[name] and inside.mean() > 0.98
    for used, exact in zip((coordinates.u, coordinates.v), reference.coordinate_map(view(name))):
        assert np.abs(used / 32 - exact)[inside].max() < 0.05 + 1e-9


@pytest.mark.parametrize("name", FOV)
def test_conventional_says_that_it_does_not_compute_the_lens(name, view):
    with pytest.raises(InputError) as caught:
        build(view(name), Options("conventional"), "rectify")
    assert str(caught.value).endswith(
        f" = {MODELS[name]}: conventional computes radial-tangential and rational lenses alone; spline takes every lens"
    )


def test_the_choice_among_datapaths_passes_conventional_over(view, monkeypatch):
    for name in set(DATAPATHS) - {"conventional", "spline"}:
        monkeypatch.delitem(DATAPATHS, name)
    chosen, other = choose(view("kalibr_omni"), 5, 0.05, "balanced")
    assert (chosen.name, chosen.verdict, other.name) == ("spline", "chosen", "conventional")
    assert other.verdict.startswith("conventional computes radial-tangential and rational lenses alone")


def test_every_pixel_of_the_verilogs_frames_is_that_of_cv2_remap(view):
    built = core(view("tum_vi_ds"))
    frames = np.random.default_rng(0).integers(0, 256, (2, SIZE[1], SIZE[0]), np.uint8)
    out = to_frames(compile_core(built.verilog, "rectify").run(to_beats(frames)).beats, *SIZE)
    coordinates = built.parameters.datapath.coordinates
    for frame, rectified in zip(frames, out, strict=True):
        np.testing.assert_array_equal(rectified, cv2_remap(frame, coordinates.u, coordinates.v))


@pytest.mark.parametrize("name", ["kalibr_omni", "ocam"])
def test_a_plan_rebuilds_to_the_same_core(name, view, tmp_path):
    built = core(view(name))
    files.write({tmp_path / "rectify.v": built.verilog, tmp_path / "rectify.json": built.plan.to_json()})
    (planned,) = load_folder(tmp_path).values()
    assert planned.rebuild().verilog == built.verilog
