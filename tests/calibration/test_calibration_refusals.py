"""What a user is told about a calibration that cannot be used: one line that names file, field and value."""

import random
import re
import time

import pytest
from calibration_files import (
    EXTRINSICS,
    EYE,
    INTRINSICS,
    RECTIFICATION,
    RIG,
    UNUSED,
    as_xml,
    as_yaml,
    refusal,
    write,
)

from hdl.calibration import FORMATS, load, unnamed_lens
from hdl.calibration.documents import MAX_BYTES
from hdl.errors import InputError

UNKNOWN = "not a stereo calibration in a known format: " + ", ".join(format.NAME for format in FORMATS)
COUNTS = " or ".join(map(str, unnamed_lens.COUNTS))
NINE = "1. 2. 3. 4. 5. 6. 7. 8. 9.".split()


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"M1": (2, 3, NINE[:6])}, "M1 = 2x3: a 3x3 matrix is needed"),
        ({"M1": (3, 3, NINE[:8])}, "M1.data = 8 values: 9 numbers are needed"),
        ({"M1": (3, "x", NINE)}, "M1.cols = x: a whole number is needed"),
        ({"M1": (3, -3, NINE)}, "M1.cols = -3: a whole number is needed"),
        ({"M1": (3, 3, NINE) , "M2": "[ 1, 2, 3 ]"}, "M2 = 3 values: 9 numbers are needed"),
        ({"M1": "[ [ 1, 2 ], [ 3, 4 ] ]"}, "M1 = 2x2: a 3x3 matrix is needed"),
        ({"M1": "[ [ 1, 2, 3 ], [ 4, 5 ], [ 6, 7, 8 ] ]"}, "M1 = 3 values: 9 numbers are needed"),
        ({"M1": 5}, "M1 = 5: a matrix with rows, cols, dt and data, or a sequence, is needed"),
        ({"M1": (3, 3, ["0."] * 9)},
         "M1 = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]: not of the form [fx s cx; 0 fy cy; 0 0 1]"),
        ({"M2": (3, 3, ["0.", *RIG["M2"][2][1:]])}, "M2 = fx 0: singular or mirrored: a focal length must be positive"),
        ({"M2": (3, 3, ["0.0036", *RIG["M2"][2][1:]])}, "M2 = fx 0.0036: no focal length in px for 640x480 images"),
        ({"M1": (3, 3, ["500.", "0.", ".Nan", *RIG["M1"][2][3:]])}, "M1.data[2] = nan: not a finite number"),
        ({"M1": (3, 3, ["500.", "0.", "abc", *RIG["M1"][2][3:]])}, "M1.data[2] = abc: not a finite number"),
        ({"M1": (3, 3, ["500.", "1e9", *RIG["M1"][2][2:]])}, "M1 = skew 1e+09: far outside a 640x480 image"),
        ({"D1": (1, 3, NINE[:3])}, f"D1 = 1x3: {COUNTS} numbers in one row or column are needed"),
        ({"D1": (2, 2, NINE[:4])}, f"D1 = 2x2: {COUNTS} numbers in one row or column are needed"),
        ({"D2": (1, 4, ["0.", "-.Inf", "0.", "0."])}, "D2.data[1] = -inf: not a finite number"),
        ({"model": "equidistant"}, "D1 = 5 coefficients: a lens of model equidistant has 4"),
        ({"model": "ftheta"}, "model = ftheta: the lens models known are radtan, rational, thin_prism, tilted, "
                              "equidistant, double_sphere, eucm, mei, fov, scaramuzza"),
        ({"model": "radtan", "D1": (1, 20, NINE + NINE + NINE[:2])},
         "D1 = 20 coefficients: a lens of model tilted has 0 or 4 or 5 or 8 or 12 or 14"),
        ({"model": "fov"}, "D1 = 5 coefficients: a lens of model fov has 1"),
        ({"fisheye_model": "yes"}, "fisheye_model = yes: 0 or 1 is needed"),
        ({"R": (3, 3, ["1.1", *EYE[1:]])}, "R = [[1.1, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]: "
                                          "not a rotation: R^T R differs from the identity by 0.21"),
        ({"R": (3, 3, ["-1.", *EYE[1:]])}, "R = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]: "
                                          "not a rotation: its determinant is -1"),
        ({"R": (3, 1, NINE[6:])}, "R = [7.0, 8.0, 9.0]: a rotation vector in rad is needed"),
        ({"R": (3, 2, NINE[:6])}, "R = 3x2: a 3x3 matrix is needed"),
        ({"R": "[ 1, 2 ]"}, "R = 2 values: 9 numbers are needed"),
        ({"T": (3, 1, ["0.", "0.", "0."])},
         "T = [0.0, 0.0, 0.0]: the two cameras are in one place; a stereo rig has a baseline"),
        ({"T": (3, 1, ["-1.", "0.", "100."])},
         "T = [-1.0, 0.0, 100.0]: one camera stands behind the other, and what lies on the way from one to the other "
         "has no disparity; stereo needs them side by side. Is it T of x_right = R x_left + T, with z along the view?"),
        ({"T": (3, 1, ["1e300", "0.", "0."])}, "T = [1e+300, 0.0, 0.0]: no length of a baseline in any unit"),
        ({"T": (3, 1, ["-1e-12", "0.", "0."])}, "T = [-1e-12, 0.0, 0.0]: no length of a baseline in any unit"),
        ({"T": (1, 2, ["-1.", "0."])}, "T = 1x2: 3 numbers in one row or column are needed"),
        ({"T": "[ -1., 0. ]"}, "T = 2 values: 3 numbers in one row or column are needed"),
        ({"T": "[ -1., 0., abc ]"}, "T[2] = abc: not a finite number"),
        ({"image_width": "wide"}, "image_width = wide: a whole number of pixels is needed"),
        ({"image_width": '"640 px"'}, "image_width = 640 px: a whole number of pixels is needed"),
        ({"image_width": "[ 640, 480 ]"}, "image_width = [640, 480]: a whole number of pixels is needed"),
        ({"image_height": ".Nan"}, "image_height = nan: a whole number of pixels is needed"),
        ({"image_height": 0}, "image_width, image_height = 640x0: an image size must lie between 16 and 16384 px"),
        ({"image_height": -48}, "image_width, image_height = 640x-48: an image size must lie between 16 and 16384 px"),
        ({"image_width": "9" * 400}, "image_width = inf: a whole number of pixels is needed"),
        ({"image_width": 320, "image_height": 240},
         "M1 = cx 320.5: the principal point lies outside the 320x240 image: of another size?"),
        ({"K1": RIG["M1"]}, "M1: also given as K1; keep one of them"),
    ],
)  # fmt: skip
def test_bad_fields_are_named_with_their_value(change, message):
    assert refusal(write(as_yaml(RIG | change))) == f"rig.yml: {message}"


@pytest.mark.parametrize(
    "change, message",
    [
        ({"R1": (3, 3, ["2.", *EYE[1:]])}, "R1 = [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]: "
                                          "not a rotation: R^T R differs from the identity by inf"),
        ({"P1": (3, 3, EYE)}, "P1 = 3x3: a 3x4 matrix is needed"),
        ({"P1": (3, 4, ["-450.", *RECTIFICATION["P1"][2][1:]])},
         "P1 = fx -450: singular or mirrored: a focal length must be positive"),
        ({"P2": (3, 4, [*RECTIFICATION["P2"][2][:3], "45000.", *RECTIFICATION["P2"][2][4:]])},
         "P2 = [450.0, 0.0, 300.0, 45000.0]: the baseline has the wrong sign for a camera on the right"),
        ({"P1": (3, 4, [".Nan", *RECTIFICATION["P1"][2][1:]])}, "P1.data[0] = nan: not a finite number"),
        ({"R2": (3, 3, ["0.8", "0.", "0.6", "0.", "1.", "0.", "-0.6", "0.", "0.8"])},
         "R2 = [[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]]: "
         "does not rectify these cameras: R2 R R1^T is not the identity, or R2 T not along x"),
        ({"R2": (3, 3, ["1.", "0.", "0.", "0.", "0.8", "0.6", "0.", "-0.6", "0.8"])},
         "R2 = [[1.0, 0.0, 0.0], [0.0, 0.8, 0.6], [0.0, -0.6, 0.8]]: "
         "does not rectify these cameras: R2 R R1^T is not the identity, or R2 T not along x"),
    ],
)  # fmt: skip
def test_bad_rectifications_are_named_with_their_value(change, message):
    assert refusal(write(as_yaml(RIG | RECTIFICATION | change))) == f"rig.yml: {message}{UNUSED}"


@pytest.mark.parametrize(
    "missing, message",
    [
        ("M1", "M1 or K1: missing (stereo_calib writes it to intrinsics.yml)"),
        ("D2", "D2 or dist_coeffs_right: missing (stereo_calib writes it to intrinsics.yml)"),
        ("T", "T or translation_vector: missing (stereo_calib writes it to a second file, extrinsics.yml)"),
        ("image_height", "image_height: missing beside image_width"),
        ("P2", "P2 or projection_matrix_right: missing; R1, R2, P1 and P2 belong together" + UNUSED),
    ],
)
def test_missing_fields_are_named(missing, message):
    fields = {name: value for name, value in (RIG | RECTIFICATION).items() if name != missing}
    assert refusal(write(as_yaml(fields))) == f"rig.yml: {message}"


def test_missing_size_asks_for_the_option():
    assert refusal(write(as_yaml(INTRINSICS)), write(as_yaml(EXTRINSICS), "b.yml")) == (
        "rig.yml, b.yml: image_width: missing: "
        "the calibration does not state the size of its images; give it with --size"
    )


@pytest.mark.parametrize(
    "size, message",
    [
        ((0, 480), "--size: 0x480: an image size must lie between 16 and 16384 px"),
        ((640, 20000), "--size: 640x20000: an image size must lie between 16 and 16384 px"),
        ((640.5, 480), "--size: 640.5: a whole number of pixels is needed"),
    ],
)
def test_bad_sizes_of_the_caller_are_refused(size, message):
    assert refusal(write(as_yaml(RIG)), size=size) == message


def test_messages_name_the_file_of_a_pair_that_holds_the_field():
    paths = write(as_yaml(INTRINSICS), "a.yml"), write(as_yaml(EXTRINSICS | {"R": (3, 3, NINE)}), "b.yml")
    assert refusal(*paths, size=(640, 480)).startswith("b.yml: R = [[1.0, 2.0, 3.0], ")


def test_files_that_contradict_each_other_are_refused():
    paths = write(as_yaml(RIG), "a.yml"), write(as_yaml({"T": (3, 1, ["-1.", "0.", "0."])}), "b.yml")
    assert refusal(*paths) == "b.yml: T: differs from the T in a.yml"
    assert load(write(as_yaml(RIG), "a.yml"), write(as_yaml(EXTRINSICS), "b.yml")).T[0] == -100


@pytest.mark.parametrize(
    "content, message",
    [
        (b"", "the file is empty"),
        (b" \n\n", "the file is empty"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "not text in UTF-8 (byte 0)"),
        (b"hello: [world\n", UNKNOWN),
        (b"just words\n", UNKNOWN),
        (b"- opencv-matrix\n", "not a calibration: there are no named fields in it"),
        (b"M1: [ 1, 2\n", "line 2: while parsing a flow sequence did not find expected ',' or ']'"),
        (b"M1: 1\nM1: 2\n", "line 2: 'M1' is given twice"),
        (b"M1: !!python/object/apply:os.getcwd []\n",
         "line 1: could not determine a constructor for the tag 'tag:yaml.org,2002:python/object/apply:os.getcwd'"),
        (b"M1: !!int abc\n", "line 1: 'abc' is not a number"),
        (b"M1: &a [ 1 ]\nM2: *a\n", "line 2: aliases are refused"),
        (b"M1: " + b"[" * 40 + b"]" * 40, "line 1: nested more than 32 deep"),
        (b"M1: \x07\n", "not YAML: unacceptable character #x0007: control characters are not allowed"),
        (b"<opencv_storage><M1>", "line 1: not XML: no element found"),
        (b"<opencv_storage></M1>", "line 1: not XML: mismatched tag"),
        (b'<!DOCTYPE a [<!ENTITY b "c">]><opencv_storage>&b;</opencv_storage>',
         "XML with a document type or entities is refused"),
        (b"<!DOCTYPE opencv_storage><opencv_storage></opencv_storage>",
         "XML with a document type or entities is refused"),
        (b"<opencv_storage>" + b"<a>" * 40 + b"</a>" * 40 + b"</opencv_storage>", "a: nested more than 32 deep"),
        (b"<opencv_storage><M1>1</M1><M1>2</M1></opencv_storage>", "M1: given twice"),
        (b"x" * (MAX_BYTES + 1), "larger than 1 MiB, so not a calibration"),
    ],
)  # fmt: skip
def test_files_that_are_no_calibration_are_refused(content, message):
    assert refusal(write(content)) == f"rig.yml: {message}"


def test_files_that_cannot_be_opened_are_named(tmp_path):
    assert refusal("absent.yml") == "absent.yml: cannot be read: No such file or directory"
    assert refusal("with\0zero.yml").endswith(": cannot be read: embedded null byte")
    assert refusal("x" * 5000).endswith(": cannot be read: File name too long")
    assert refusal(tmp_path) == f"{tmp_path}: no calibration file of a known format in this folder"


def test_list_of_images_is_not_taken_for_a_calibration():
    content = '<?xml version="1.0"?>\n<opencv_storage>\n<imagelist>\n"left01.jpg"\n</imagelist>\n</opencv_storage>'
    assert refusal(write(content)).startswith("rig.yml: M1 or K1: missing")


@pytest.mark.parametrize(
    "hostile",
    [
        "M1: " + "[" * 500_000,
        "M1: " + "{a: " * 200_000,
        "- " * 400_000 + "opencv-matrix",
        "? " * 400_000 + "opencv-matrix",
        "a: &a [x, x]\n" + "".join(f"{b}: &{b} [*{a}, *{a}]\n" for a, b in zip("abcdefghij", "bcdefghijk")) + "M1: *k",
        "<opencv_storage>" + "<a>" * 150_000,
        "<opencv_storage>" + "<a>" * 100_000 + "</a>" * 100_000 + "</opencv_storage>",
    ],
)
def test_hostile_files_are_refused_at_once(hostile):
    path = write(hostile)
    start = time.process_time()
    refusal(path)
    assert time.process_time() - start < 2


@pytest.mark.parametrize("form", [as_yaml, as_xml])
def test_a_file_cut_off_anywhere_is_refused(form):
    text = form(RIG)
    for length in range(0, len(text.rstrip()) - 1, 7):
        refusal(write(text[:length]))


@pytest.mark.parametrize("form", [as_yaml, as_xml])
@pytest.mark.parametrize("seed", range(60))
def test_a_damaged_file_is_read_or_refused_in_one_line(form, seed):
    rng = random.Random(seed)
    content = bytearray(form(RIG | RECTIFICATION).encode())
    for _ in range(rng.randint(1, 4)):
        place = rng.randrange(len(content))
        damage = [*b'\x00\xff-[}"\n\t|<', rng.randrange(256)]
        pieces = [b"nan", b".Nan", b"1e308", b"9" * 30, b": ", b"&a ", b"*a", b"!!int ", b"<a>", b"null", b"- "]
        content[place : place + rng.choice([0, 1, 8, 80])] = rng.choice(pieces + [bytes([byte]) for byte in damage])
    try:
        load(write(bytes(content)))
    except InputError as error:
        assert re.fullmatch(r"rig\.yml: .+", str(error))
