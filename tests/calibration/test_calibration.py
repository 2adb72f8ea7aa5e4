"""Reading calibrations: which files are read, what is read from them, and how a rig is scaled."""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from calibration_files import EXTRINSICS, INTRINSICS, RECTIFICATION, RIG, as_xml, as_yaml, refusal, write
from format_files import SHARED, needs_shared_data

from hdl import calibration
from hdl.calibration import embedded, load


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def numbers(fields, name):
    rows, cols, data = fields[name]
    return np.array(data, dtype=float).reshape(rows, cols)


def assert_is_rig(rig, fields=RIG, size=(640, 480)):
    assert (rig.width, rig.height) == size
    for camera, K, D in ((rig.left, "M1", "D1"), (rig.right, "M2", "D2")):
        assert np.array_equal(camera.K, numbers(fields, K))
        assert np.array_equal(camera.D, numbers(fields, D).ravel())
        assert camera.K.dtype == camera.D.dtype == np.float64
    assert np.abs(rig.R - numbers(fields, "R")).max() < 1e-8  # the nearest rotation: the file rounds
    assert np.abs(rig.R.T @ rig.R - np.eye(3)).max() < 1e-14
    assert np.array_equal(rig.T, numbers(fields, "T").ravel())


@pytest.mark.parametrize(
    "header", ["%YAML:1.0\n---\n", "%YAML:1.0\n", "%YAML 1.2\n---\n", "", "\ufeff%YAML:1.0\r\n---\n"]
)
def test_yaml_headers_of_every_opencv_version_are_read(header):
    assert_is_rig(load(write(as_yaml(RIG, header))))


def test_xml_gives_the_same_rig_as_yaml():
    assert_is_rig(load(write(as_xml(RIG), "rig.xml")))


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
def test_files_that_opencv_itself_writes_are_read_to_the_last_bit(suffix):
    rng = np.random.default_rng(1)
    name = f"written.{suffix}"
    storage = cv2.FileStorage(name, cv2.FILE_STORAGE_WRITE)
    values = {key: numbers(RIG, key) for key in ("M1", "D1", "M2", "D2", "R", "T")}
    values["D1"] = rng.normal(scale=[[0.2, 1e-5, 1e-7, 1e-9, 1e-12]])
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    for key, value in values.items():
        storage.write(key, value)
    storage.release()
    rig = load(name)
    assert np.array_equal(rig.left.D, values["D1"].ravel())
    assert np.array_equal(rig.right.K, values["M2"])
    assert rig.unit is None and rig.source == name


def test_format_is_chosen_by_content_not_by_name():
    assert_is_rig(load(write(as_xml(RIG), "rig.yml")))
    assert_is_rig(load(write(as_yaml(RIG), "rig.txt")))


@pytest.mark.parametrize(
    "names",
    [
        {"M1": "K1", "M2": "K2"},
        {"M1": "camera_matrix_left", "M2": "camera_matrix_right", "D1": "dist_coeffs_left", "D2": "dist_coeffs_right"},
        {"image_width": "image_Width", "image_height": "image_Height"},
        {"image_width": "imageWidth", "image_height": "imageHeight"},
        {"R": "rotation_matrix", "T": "translation_vector"},
    ],
)
def test_other_spellings_are_read(names):
    assert_is_rig(load(write(as_yaml({names.get(name, name): value for name, value in RIG.items()}))))


@pytest.mark.parametrize("name", ["imageSize", "image_size", "ImageSize"])
@pytest.mark.parametrize("form", ["yaml", "xml"])
def test_image_size_may_be_a_pair(name, form):
    fields = {**INTRINSICS, **EXTRINSICS, name: "[ 640, 480 ]" if form == "yaml" else "\n  640 480"}
    assert_is_rig(load(write((as_yaml if form == "yaml" else as_xml)(fields))))


@pytest.mark.parametrize("data", [["-0.25", "0.0625", "0.", "0.", "0."], []])
def test_lens_coefficients_may_be_a_column_or_none(data):
    rig = load(write(as_yaml(RIG | {"D1": (len(data), min(len(data), 1), data)})))
    assert np.array_equal(rig.left.D, np.array(data, dtype=float))
    assert rig.left.model == "radtan"


@pytest.mark.parametrize(
    "spelling, value",
    [("1.e-001", 0.1), ("1e-1", 0.1), ("+.5", 0.5), ("-5.E-2", -0.05), ("1", 1.0), ("010", 10.0), ("0.", 0.0)],
)
def test_number_spellings_of_opencv_and_of_people(spelling, value):
    D1 = (1, 4, [spelling, "0.", "0.", "0."])
    assert load(write(as_yaml(RIG | {"D1": D1}))).left.D[0] == value
    assert load(write(as_xml(RIG | {"D1": D1}))).left.D[0] == value


def test_a_value_may_follow_its_key_without_a_space():
    text = as_yaml(RIG).replace("data: [", "data:[").replace("image_width: ", "image_width:")
    assert "image_width:640" in text and "data:[" in text
    assert_is_rig(load(write(text)))


def test_intrinsics_and_extrinsics_pair_in_either_order():
    paths = write(as_yaml(INTRINSICS), "intrinsics.yml"), write(as_yaml(EXTRINSICS), "extrinsics.yml")
    assert_is_rig(load(*paths, size=(640, 480)))
    assert_is_rig(load(*reversed(paths), size=(640, 480)))
    assert load(*paths, size=(640, 480)).source == "intrinsics.yml, extrinsics.yml"


def test_size_of_the_caller_serves_only_where_the_file_has_none():
    stated, unstated = write(as_yaml(RIG), "a.yml"), write(as_yaml(INTRINSICS | EXTRINSICS), "b.yml")
    assert load(unstated, size=(800, 600)).left.K[0, 2] == 320.5
    assert load(stated, size=(1280, 960)).left.K[0, 2] == 321 * 2 - 0.5


def test_rectification_of_the_file_is_kept():
    rig = load(write(as_yaml(RIG | RECTIFICATION)))
    for number, side in ((1, "left"), (2, "right")):
        R, P = rig.rectification[side]
        assert np.array_equal(R, numbers(RECTIFICATION, f"R{number}"))
        assert np.array_equal(P, numbers(RECTIFICATION, f"P{number}"))
    assert load(write(as_yaml(RIG))).rectification is None


@pytest.mark.parametrize(
    "count, used, model",
    [
        (4, 4, "radtan"),
        (5, 5, "radtan"),
        (8, 8, "rational"),
        (12, 12, "thin_prism"),
        (14, 14, "tilted"),
        (14, 8, "rational"),
        (14, 5, "radtan"),
        (8, 0, "radtan"),
    ],
)
def test_lens_model_follows_from_the_coefficients_in_use(count, used, model):
    rig = load(write(as_yaml(RIG | {"D1": (1, count, ["0.001"] * used + ["0."] * (count - used))})))
    assert rig.left.model == model
    assert rig.left.D.size == count


@pytest.mark.parametrize("field", [{"model": "equidistant"}, {"distortion_model": "fisheye"}, {"fisheye_model": 1}])
def test_equidistant_lenses_are_those_the_file_calls_so(field):
    four = (4, 1, ["-0.01", "0.02", "-0.03", "0.04"])
    rig = load(write(as_yaml(RIG | {"D1": four, "D2": four} | field)))
    assert (rig.left.model, rig.right.model) == ("equidistant", "equidistant")


def test_embedded_rig_is_the_opencv_sample_pair():
    rig = embedded()
    assert (rig.source, rig.width, rig.height) == ("opencv_samples.yml", 640, 480)
    assert rig.left.K[0].tolist() == [534.1393199747979, 0, 342.15871906794291]
    assert rig.left.K[1].tolist() == [0, 534.10071813640457, 234.72820724446376]
    assert rig.right.D[:2].tolist() == [-0.2860684095447405, 0.10134221236559657]
    assert rig.right.D[2:].tolist() == [-0.00062272792260929094, 0.00054361091247436357, 0]
    assert rig.T.tolist() == [-99.835542125955598, 1.1481066341242334, -0.20795980043610945]
    assert embedded((320, 240)).left.K[0, 0] == rig.left.K[0, 0] / 2


def test_scaling_keeps_pixel_centres_at_integers():
    rig = load(write(as_yaml(RIG | RECTIFICATION)))
    rig = replace(rig, left=replace(rig.left, K=rig.left.K + [[0, 2.0, 0], [0, 0, 0], [0, 0, 0]]))
    scaled = rig.scaled(1280, 240)
    assert scaled.left.K.tolist() == [[1000.5, 4, 321 * 2 - 0.5], [0, 250.875, 240.625 / 2 - 0.5], [0, 0, 1]]
    R, P = scaled.rectification["right"]
    assert P.tolist() == [[900, 0, 600.5, -90000], [0, 225, 124.75, 0], [0, 0, 1, 0]]
    assert np.array_equal(R, numbers(RECTIFICATION, "R2"))
    assert np.array_equal(scaled.T, rig.T) and np.array_equal(scaled.left.D, rig.left.D)
    assert np.allclose(scaled.scaled(640, 480).left.K, rig.left.K, rtol=1e-15)
    assert rig.scaled(640, 480) is rig


def format_of(rig, recognises=lambda document: True):
    return SimpleNamespace(
        NAME="other", TITLE="Other", SEVERAL_FILES=False, SELECT=None, recognises=recognises,
        read=lambda documents, size, select: rig,
    )  # fmt: skip


def test_a_further_format_is_one_entry_in_the_registry(monkeypatch):
    other = format_of(embedded(), recognises=lambda document: document.text.startswith("other"))
    monkeypatch.setattr(calibration, "FORMATS", (calibration.opencv, other))
    assert load(write("other", "o.txt")).source == "opencv_samples.yml"
    assert load("o.txt").format == "other"
    assert refusal("o.txt", write(as_yaml(RIG))) == (
        "other: o.txt; opencv: rig.yml: files of different calibration formats; name those of one"
    )
    known = "not a stereo calibration in a known format: opencv, other"
    assert refusal("o.txt", write("neither", "n.txt")) == f"n.txt: {known}"


def test_every_rig_is_checked_whichever_format_it_comes_from(monkeypatch):
    rig = embedded()
    lengthwise = replace(rig, source="o.txt", T=rig.T[[2, 1, 0]], fields={"T": ("o.txt", "baseline")})
    monkeypatch.setattr(calibration, "FORMATS", (format_of(lengthwise),))
    assert refusal(write("other", "o.txt")).startswith("o.txt: baseline = [")


@needs_shared_data
@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
def test_sample_calibration_in_every_form_is_the_embedded_rig(suffix):
    rig = load(SHARED / "rigs" / "opencv_samples" / "calibrated" / f"opencv_left_right.{suffix}")
    default = embedded()
    for name in ("left", "right"):
        assert np.array_equal(rig.camera(name).K, default.camera(name).K)
        assert np.array_equal(rig.camera(name).D, default.camera(name).D)
    assert np.array_equal(rig.R, default.R) and np.array_equal(rig.T, default.T)


@needs_shared_data
def test_calibration_with_the_names_of_other_programs_is_read():
    rig = load(SHARED / "rigs" / "unlook_1456" / "calib_boofcv_test3.yaml")
    assert (rig.width, rig.height, rig.left.K[0, 2]) == (1456, 1088, 738.33146152838935)
    assert rig.rectification["right"][1][0, 3] == -122910.79229011171
