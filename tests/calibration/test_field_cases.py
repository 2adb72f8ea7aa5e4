"""Small calibrations in the forms that people really have, ../shared/data/field: each is read as its cases.yml says."""

import re

import cv2
import numpy as np
import pytest
import yaml
from format_files import SHARED

from hdl import calibration
from hdl.errors import InputError
from hdl.geometry.notes import warnings
from hdl.geometry.rectification import rectify

FIELD = SHARED / "field"
CASES = yaml.safe_load((FIELD / "cases.yml").read_text()) if (FIELD / "cases.yml").is_file() else []

# The words of "says" and "kind" that matter, as patterns: each must occur in what is said, in any wording around it.
WORDS = {
    "fisheye_D_sequence.yml": ["--lens-model"],
    "fisheye_unnamed.yml": ["--lens-model"],
    "zed_disto_beside.conf": ["DISTO"],
    "ros_no_model_left.yaml": ["plumb_bob", "--lens-model"],
    "ros_fisheye_P_differ_left.yaml": ["anew"],
    "mc_calib.yml": ["MC-Calib", "[Cc]onvert"],
    "right_camera_upside_down.yml": ["right camera", "upside down", "180 degrees"],
    "right_camera_quarter_turned.yml": ["right camera", "90 degrees"],
    "rectification_upside_down.yml": ["180 degrees", "--alpha"],
    "rectification_zooms.yml": ["magnif", "--alpha", "--fov"],
    "baseline_along_view.yml": ["(behind|in front of) the other"],
}


@pytest.mark.skipif(not CASES, reason="the reference data, ../shared/data/field, is not here")
def test_words_are_looked_for_where_something_is_to_be_said():
    first = {case["files"][0] for case in CASES}
    assert WORDS.keys() <= first
    assert {case["files"][0] for case in CASES if "says" in case} <= WORDS.keys()


@pytest.mark.skipif(not CASES, reason="the reference data, ../shared/data/field, is not here")
@pytest.mark.parametrize("case", CASES or [None], ids=lambda case: case["files"][0] if case else "absent")
def test_file_comes_out_as_its_case_says(case):
    rig, said = _read(case)
    assert (rig is None) == case.get("refuse", False), said
    for words in WORDS.get(case["files"][0], ()):
        assert re.search(words, said), said
    if "never" in case:
        assert case["never"] not in said
    if "model" in case:
        assert (rig.left.model, rig.right.model) == (case["model"], case["model"])
    if "T" in case:
        assert rig.T == pytest.approx(case["T"], abs=1e-6)
    if "T_norm" in case:
        assert np.linalg.norm(rig.T) == pytest.approx(case["T_norm"], abs=1e-4)
    if "R" in case:
        assert cv2.Rodrigues(rig.R)[0].ravel() == pytest.approx(case["R"], abs=1e-6)


def _read(case):
    """The rig, rectified as by default, and all that is said of it; None and the line of the refusal."""
    try:
        rig = calibration.load(*(FIELD / name for name in case["files"]))
        views = rectify(rig, lens=True)
    except InputError as error:
        assert "\n" not in str(error)
        return None, str(error)
    return rig, "\n".join(warnings(rig, views))
