"""What is warned of, and what becomes of a rectification that does not fit its cameras."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from calibration_files import RECTIFICATION, RIG, UNUSED, as_yaml, refusal, write

from hdl.calibration import embedded, load
from hdl.calibration.suspicions import row_difference
from hdl.geometry.rectification import rectify

FOUR = (1, 4, ["-0.01", "0.02", "-0.03", "0.04"])


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def K(fx=500, cx=320, cy=240, fy=None):
    return 3, 3, [f"{fx}.", "0.", f"{cx}.", "0.", f"{fy or fx}.", f"{cy}.", "0.", "0.", "1."]


def opencv_rectification(rig, R=None):
    """R1, P1, R2, P2 of cv2.stereoRectify, as fields of a file."""
    R1, R2, P1, P2 = cv2.stereoRectify(
        rig.left.K, rig.left.D, rig.right.K, rig.right.D, (rig.width, rig.height), rig.R if R is None else R,
        rig.T[:, None], flags=cv2.CALIB_ZERO_DISPARITY, alpha=0,
    )[:4]  # fmt: skip
    return {name: (3, M.shape[1], list(map(repr, M.ravel().tolist()))) for name, M in
            (("R1", R1), ("P1", P1), ("R2", R2), ("P2", P2))}  # fmt: skip


def test_good_calibration_has_no_warnings():
    assert load(write(as_yaml(RIG))).warnings == ()
    assert load(write(as_yaml(RIG | RECTIFICATION))).warnings == ()


@pytest.mark.parametrize(
    "change, message",
    [
        ({"T": (3, 1, ["100.", "0.", "0."])},
         "T = [100.0, 0.0, 0.0]: the camera called left is on the right (x_right = R x_left + T with T.x > 0), so "
         "disparities are negative; are the cameras exchanged, or do R and T lead from right to left?"),
        ({"M2": K(cx=380)}, "M2 = cx 380: far from the middle of a 640x480 image: calibrated at another size?"),
        ({"M1": K(cy=200)}, "M1 = cy 200: far from the middle of a 640x480 image: calibrated at another size?"),
        ({"M1": K(fx=500, fy=600)}, "M1 = fx 500, fy 600: pixels are seldom so far from square"),
        ({"D2": (1, 5, ["-0.2", "0.1", "0.3", "0.001", "0.002"])},
         "D2 = [-0.2, 0.1, 0.3, 0.001, 0.002]: large tangential terms: OpenCV's order k1, k2, p1, p2, k3 is meant"),
        ({"M2": RIG["M1"], "D2": RIG["D1"]},
         "M2 = [[500.25, 0.0, 320.5], [0.0, 501.75, 240.125], [0.0, 0.0, 1.0]]: "
         "both cameras have the same numbers to the last digit: one is a copy"),
        ({"unit": "m"}, "T = [-100.0, 1.5, -0.5]: a baseline of 100 m; is it in another unit than the format's?"),
    ],
)  # fmt: skip
def test_suspicious_values_are_named(change, message):
    rig = load(write(as_yaml(RIG | change)))
    assert rig.warnings == (f"rig.yml: {message}",)
    assert rectify(rig, lens=True).keys() == {"left", "right"}


def test_large_terms_of_an_equidistant_lens_are_not_tangential():
    four = (1, 4, ["-0.01", "0.02", "-0.3", "0.4"])
    assert load(write(as_yaml(RIG | {"D1": FOUR, "D2": four, "model": "equidistant"}))).warnings == ()


def test_warnings_survive_scaling_and_speak_of_the_file():
    rig = load(write(as_yaml(RIG | {"M2": K(cx=380)})), size=(320, 240))
    problem = "far from the middle of a 640x480 image: calibrated at another size?"
    assert rig.warnings == (f"rig.yml: M2 = cx 380: {problem}",)


@pytest.mark.parametrize("given", [False, True])
def test_cameras_may_stand_the_other_way_round(given):
    """T.x of either sign: the same rows, and disparities of the other sign."""
    rig = embedded()
    fields = RIG | {"R": _matrix(rig.R.T), "T": _matrix(-rig.R.T @ rig.T), "M1": _matrix(rig.right.K),
                    "M2": _matrix(rig.left.K), "D1": _matrix(rig.right.D), "D2": _matrix(rig.left.D)}  # fmt: skip
    mirrored = load(write(as_yaml(fields)))
    if given:
        mirrored = load(write(as_yaml(fields | opencv_rectification(mirrored))))
    views, straight = rectify(mirrored, lens=True), rectify(rig, lens=True)
    assert len(mirrored.warnings) == 1 and (mirrored.rectification is not None) == given
    assert views["right"].P[0, 3] == pytest.approx(-straight["right"].P[0, 3])
    assert np.abs(views["right"].map()[1] - straight["left"].map()[1]).max() < 1e-6
    rows = row_difference(mirrored, {side: (view.R, view.P) for side, view in views.items()})
    assert rows < 1e-9


def _matrix(values):
    values = np.atleast_2d(values)
    return *values.shape, list(map(repr, values.ravel().tolist()))


def test_rectification_and_t_that_lead_in_opposite_directions_are_refused():
    message = refusal(write(as_yaml(RIG | RECTIFICATION | {"T": (3, 1, ["99.98", "1.99986667", "0."])})))
    assert message == (
        "rig.yml: T = [99.98, 1.99986667, 0.0]: "
        "leads from the right camera to the left one, but P2 the other way; give R^T and -R^T T" + UNUSED
    )


def test_baseline_of_p2_in_another_unit_is_warned_of():
    P2 = (3, 4, ["450.", "0.", "300.", "-45.", *RECTIFICATION["P2"][2][4:]])
    rig = load(write(as_yaml(RIG | RECTIFICATION | {"P2": P2})))
    message = "rig.yml: P2 = [450.0, 0.0, 300.0, -45.0]: its baseline, -0.1, is not that of T, -100"
    assert (rig.warnings, rig.rectification_warnings) == ((), (message,))
    assert rig.rectification is not None


class TestRectificationOfTheFile:
    def test_exact_one_decides_on_the_last_digits_of_r(self):
        rig = embedded()
        rounded = {"R": _matrix(rig.R.round(7))}
        fields = {"M1": _matrix(rig.left.K), "D1": _matrix(rig.left.D), "M2": _matrix(rig.right.K),
                  "D2": _matrix(rig.right.D), "T": _matrix(rig.T)}  # fmt: skip
        again = load(write(as_yaml(RIG | fields | opencv_rectification(rig) | rounded)))
        assert not again.warnings
        assert np.abs(again.R - rig.R).max() < 1e-12
        assert row_difference(again) < 1e-9

    def test_rows_that_differ_a_little_are_warned_of(self):
        rig = load(write(as_yaml(RIG)))
        tilted = cv2.Rodrigues(np.array([1e-3, 0, 0]))[0] @ rig.R
        again = load(write(as_yaml(RIG | opencv_rectification(rig, tilted))))
        (warning,) = again.rectification_warnings
        assert again.rectification is not None
        assert warning.startswith("rig.yml: P2 = [[")
        assert warning.endswith("rows of the rectification in the file differ by up to 0.60 px, 10 baselines away")

    @pytest.mark.parametrize("transposed, why", [
        (True, "as they belong to the transpose of R"), (False, "as they are not of these cameras"),
    ])  # fmt: skip
    def test_rows_that_differ_more_rule_it_out(self, transposed, why):
        rig = load(write(as_yaml(RIG)))
        R = rig.R.T if transposed else cv2.Rodrigues(np.array([2e-2, 0, 0]))[0] @ rig.R
        again = load(write(as_yaml(RIG | opencv_rectification(rig, R))))
        (warning,) = again.warnings
        assert again.rectification is None
        assert f" px, {why}; rectified anew from R and T" in warning
        assert warning.startswith("rig.yml: R2 = [[")
        assert np.abs(again.R - rig.R).max() < 1e-15

    def test_turn_that_only_disparities_show_is_warned_of(self):
        """About the vertical axis, with a T that keeps to the baseline of the file."""
        rig = load(write(as_yaml(RIG | RECTIFICATION)))
        R1, R2 = (rig.rectification[side][0] for side in ("left", "right"))
        given = _matrix(np.linalg.inv(R2) @ cv2.Rodrigues(np.array([0, 1e-4, 0]) * 2)[0] @ R1)
        again = load(write(as_yaml(RIG | RECTIFICATION | {"R": given})))
        (warning,) = again.rectification_warnings
        assert warning.endswith("leave the cameras turned by 0.011 degrees: disparities are off")

    def test_skew_takes_no_part_in_it(self):
        skewed = (3, 3, ["500.25", "7.", *RIG["M1"][2][2:]])
        assert load(write(as_yaml(RIG | RECTIFICATION | {"M1": skewed}))).warnings == ()


def test_exchanged_rig_is_the_same_rig():
    rig = load(write(as_yaml(RIG | RECTIFICATION)))
    other = rig.exchanged()
    assert other.left is rig.right and other.fields["K1"] == rig.fields["K2"]
    assert other.rectification["left"][1] is rig.rectification["right"][1]
    point = np.array([0.3, -0.2, 5])
    assert other.R @ (rig.R @ point + rig.T) + other.T == pytest.approx(point, abs=1e-7)  # R has ten digits
    back = other.exchanged()
    assert np.abs(back.R - rig.R).max() < 1e-15 and np.abs(replace(back).T - rig.T).max() < 1e-5
