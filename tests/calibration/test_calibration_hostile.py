"""Files that are broken, or made to do harm: each is read or refused in one line, at once, in whichever format."""

import json
import os
import re
import struct
import time
import tracemalloc
import zlib

import numpy as np
import pytest
from calibration_files import RECTIFICATION, RIG, as_xml, as_yaml, refusal, write
from format_files import RIGS, bouguet_camera, matlab
from forms import FORMS
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from hdl.calibration import FORMATS, load
from hdl.errors import InputError

NAMES = [format.NAME for format in FORMATS]
SECONDS = 2.0
FUZZ = settings(
    max_examples=40, deadline=None, derandomize=True, database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.data_too_large],
)  # fmt: skip

TEXTS = {
    "ros": "ps4eye", "euroc": "mynteye_s_jpl", "kalibr": "tum_vi", "kitti": "kitti", "depthai": "oakd", "zed": "zed",
    "zed-opencv": "zed_tool", "mynt": "mynteye_s1030_pinhole", "mynt fisheye": "mynteye_s1030_equidistant",
    "orbslam": "euroc_orbslam",
    "orbslam3": "tum_vi_orbslam3",
}  # fmt: skip
FILES = {name: RIGS[rig] for name, rig in TEXTS.items()} | FORMS  # the name begins with the format's
SAME_NAMES = {("plain", "opencv"), ("zed-opencv", "plain")}  # files of the one are of the other, too
TOKENS = [
    "", "nan", ".nan", "-.inf", "1e308", "-1e308", "1e-308", "9" * 400, "0", "-1", "1e999", "0x10", "1_000", "１",
    "true", "null", "[", "]", "{", "}", "[]", "{}", ":", ": ", "- ", "\n", "\t", "\0", '"', "'", "&a ", "*a", "!!int ",
    "#", "=", ",", ";", "%", "[[[[", "640", "\u2028", "\ud7ff", "<a>", "cam1:", "[STEREO]", "!!python/name:os.abort ",
]  # fmt: skip


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def read_or_refused(*paths, **options):
    """Loads; an InputError must be one line. Anything else that is raised fails the test."""
    try:
        rig = load(*paths, **options)
    except InputError as error:
        assert re.fullmatch(r".+", str(error))
    else:
        assert np.isfinite(rig.left.K).all() and np.isfinite(rig.R).all() and np.isfinite(rig.T).all()
        assert all("\n" not in warning for warning in rig.warnings)


def damaged(text):
    """A strategy: ``text`` with a few pieces cut out, doubled or replaced, mostly where numbers and words are."""
    words = [match.span() for match in re.finditer(r"[^\s,\[\]:=]+", text)]
    spans = st.tuples(st.integers(0, len(text)), st.integers(0, 60)).map(lambda span: (span[0], sum(span)))
    place = st.one_of(st.sampled_from(words), spans)
    new = st.one_of(st.sampled_from(TOKENS), st.text(max_size=8), st.floats().map(repr), st.integers().map(str))
    return st.lists(st.tuples(place, new), min_size=1, max_size=4).map(lambda edits: _edited(text, edits))


def _edited(text, edits):
    for (start, end), new in sorted(edits, reverse=True):
        text = text[:start] + new + text[end:]
    return text


def encoded(text):
    return text.encode("utf-8", "surrogatepass")


@pytest.mark.parametrize("name", FILES)
@FUZZ
@given(data=st.data())
def test_damaged_text_is_read_or_refused(name, data):
    files = FILES[name]
    names = list(files.contents)
    victim = data.draw(st.sampled_from(names))
    for other, content in files.contents.items():
        write(encoded(data.draw(damaged(content)) if other == victim else content), other)
    read_or_refused(*names, format=name.split(" ")[0])


# Of a lens without a name, and with sequences for vectors.
UNNAMED = {"D1": "[ -0.013, -0.0052, 0.0063, -0.0031 ]", "D2": "[ -0.0127, -0.0049, 0.0057, -0.0028 ]",
           "T": "[ -99.98, -1.99986667, 0. ]"}  # fmt: skip


@pytest.mark.parametrize("form, change", [(as_yaml, {}), (as_xml, {}), (as_yaml, UNNAMED)])
@FUZZ
@given(data=st.data())
def test_damaged_opencv_file_is_read_or_refused(form, change, data):
    read_or_refused(write(encoded(data.draw(damaged(form(RIG | RECTIFICATION | change))))))


@pytest.mark.parametrize("name", NAMES)
@FUZZ
@given(content=st.one_of(st.binary(max_size=200), st.text(max_size=200).map(encoded), st.sampled_from(list(FILES))))
def test_any_file_is_refused_by_a_format_that_it_is_not_of(name, content):
    if isinstance(content, str):
        own, content = content.split(" ")[0], encoded(next(iter(FILES[content].contents.values())))
        if own == name or (own, name) in SAME_NAMES:
            return
    for paths in ([write(content)], [write(content), write(content, "again")]):
        assert refusal(*paths, format=name)


@pytest.mark.parametrize("name", ["kalibr", "kitti", "depthai", "zed", "mynt", "basalt", "okvis", "realsense"])
@FUZZ
@given(select=st.one_of(st.text(max_size=12), st.from_regex(r"(cam|CAM_)?[0-9A-C]{1,2},(cam|CAM_)?[0-9]{1,2}")))
def test_any_choice_is_understood_or_refused(name, select):
    files = FILES[name]
    read_or_refused(*[write(content, path) for path, content in files.contents.items()], select=select)


@FUZZ
@given(value=st.recursive(
    st.one_of(st.none(), st.booleans(), st.floats(), st.integers(-10, 2000), st.text(max_size=5)),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(
        st.sampled_from(["cameraData", "stereoRectificationData", "extrinsics", "width", "height", "x", "y", "z",
                         "leftCameraSocket", "rightCameraSocket", "translation", "intrinsicMatrix", "cameraType",
                         "cam0", "cam1", "img_params", "intrinsics", "T_BS", "resolution", "rows", "cols", "data",
                         "cameras", "T_SC", "camera", "T_B_C", "distortion", "type", "T_imu_cam", "camera_type",
                         "K1", "D1", "K2", "D2", "R", "T", "left", "K", "D", "size", "unit", "model",
                         "fisheye", "k", "p", "header",
                         "Camera", "StereoRectifier", "Camera.type", "Tlr", "cam0_calib", "transform"]),
        inner, max_size=6)), max_leaves=20))  # fmt: skip
def test_any_structure_is_read_or_refused(value):
    path = write(encoded(json.dumps(value)))
    for name in NAMES:
        read_or_refused(path, format=name)


ALIASES = "a: &a [x, x]\n" + "".join(f"{b}: &{b} [*{a}, *{a}]\n" for a, b in zip("abcdefghij", "bcdefghijk"))
HOSTILE = {
    "ros": ["camera_matrix: " + "[" * 300_000 + "\nprojection_matrix: 1",
            ALIASES + "camera_matrix: *k\nprojection_matrix: *k",
            "camera_matrix: {rows: 1000000000, cols: 1000000000, data: []}\nprojection_matrix: {}",
            "projection_matrix: 1\ncamera_matrix: [" + "1, " * 300_000 + "]"],
    "euroc": ["T_BS: " + "{a: " * 200_000 + "\nintrinsics: 1", ALIASES + "T_BS: *k\nintrinsics: 1"],
    "kalibr": ["null: 1\n5: 6\ncam0:\n  intrinsics: []\n",
               "".join(f"cam{n}:\n  intrinsics: []\n" for n in range(4_000)),
               "cam0:\n  intrinsics: " + "- " * 400_000],
    "kitti": ["K_00: " + "1 " * 500_000, "".join(f"K_{n % 100:02}{n}: 1\n" for n in range(60_000)),
              "K_00:\n" + ":\n" * 400_000],
    "depthai": ['{"cameraData": ' + "[" * 900_000, '{"cameraData": ' + "[" * 500 + "]" * 500 + "}",
                '{"cameraData": ' + "[" * 100_000 + "]" * 100_000 + "}", '{"cameraData": "' + '\\"' * 400_000,
                '{"cameraData": ' + "9" * 1_000_000 + "}", '{"cameraData": [' + "[1,{}]," * 50_000 + "[1,{}]]}"],
    "zed": ["[LEFT_CAM_HD]\n" + "a\n" * 400_000, "".join(f"[LEFT_CAM_{n}]\n" for n in range(50_000)),
            "[LEFT_CAM_HD]\nfx=" + " 1\n" * 300_000, "[LEFT_CAM_HD]\n" + "".join(f"{n}=1\n" for n in range(90_000))],
    "mynt": ["img_params: { ? [ 1 ] : 2 }", "img_params: " + "[" * 500_000,
             "img_params:\n" + "   - {model: 0, width: 640, height: 400}\n" * 4_000],
    "orbslam": [ALIASES + "LEFT.K: *k", "LEFT.K: !!opencv-matrix\n  rows: 9999999999\n  cols: 1\n  data: [ 1 ]"],
    "orbslam3": [ALIASES + "Camera1.fx: *k\nCamera2.fx: *k", "Camera1.fx: 1\nCamera2.fx: " + "[" * 300_000],
    "basalt": ['{"T_imu_cam": ' + "[" * 500_000 + '"camera_type": 1',
               '{"T_imu_cam": [' + "{}," * 200_000 + '{}], "camera_type": 1}'],
    "okvis": ["cameras:\n" + "- {T_SC: 1}\n" * 30_000, ALIASES + "cameras: *k\nT_SC: 1"],
    "aslam": ["cameras:\n" + "- {T_B_C: 1}\n" * 30_000],
    "ov2slam": ["Camera.fxl: " + "{a: " * 200_000],
    "vins": ["cam0_calib: " + "x" * 900_000, "model_type: " + "[" * 300_000, "cam0_calib: /dev/zero\ncam1_calib: x\n"],
    "stella": ["StereoRectifier: " + "[" * 300_000, "".join(f"StereoRectifier.K_left{n}: 1\n" for n in range(20_000))],
    "realsense": ['Intrinsic of "a" / 640x480 / {}\n' * 25_000, 'Intrinsic of "Infrared 1" / ' + "9" * 900_000,
                  'Extrinsic from "a" To "b"\nIntrinsic of "a" / 1x1 / {}\n' + "1 " * 400_000],
    "ros-message": ["height:\nk:\np:\n" + "---\n" * 200_000, "height: 1\nk: 1\np: 1\n---\n" * 3_000,
                    "height: 1\nk: [" + "1, " * 300_000 + "]\np: 1"],
    "ost": ["[image]\ncamera matrix\nprojection\n" * 20_000,
            "[image]\ncamera matrix\n" + "1 " * 400_000 + "\nprojection\n",
            "[image]\n" * 100_000 + "camera matrix\nprojection\n"],
    "plain": ['{"K1": ' + "[" * 900_000, "K1: [1]\n" * 50_000, '{"K1": [' + "1," * 400_000 + "1]}",
              '{"left": {"left": {"K1": [' + "[1]," * 50_000 + "[1]]}}}", "a b " * 250_000 + ": [1]\nK1: [1]"],
}  # fmt: skip


@pytest.mark.parametrize("name, number", [(name, n) for name, texts in HOSTILE.items() for n in range(len(texts))])
def test_hostile_text_is_refused_at_once(name, number):
    path = write(HOSTILE[name][number])
    start = time.process_time()
    refusal(path)
    refusal(path, format=name)
    assert time.process_time() - start < 2 * SECONDS


WORDS = [struct.pack("<I", number) for number in (0, 1, 2, 5, 9, 14, 15, 17, 1 << 16, 1 << 20, 0x7FFFFFFF, 0xFFFFFFFF)]


@pytest.fixture(scope="module")
def valid(tmp_path_factory):
    """The bytes of a MAT-file of MATLAB's parameters, not compressed."""
    path = tmp_path_factory.mktemp("mat") / "valid.mat"
    cameras = [bouguet_camera("left"), bouguet_camera("right")]
    variables = matlab(np.eye(3), [-60.0, 0, 0], cameras, (640, 480))
    for number in (1, 2):
        variables[f"CameraParameters{number}"]["WorldPoints"] = np.zeros((0, 2))
    savemat(path, {"s": variables}, do_compression=False)
    return path.read_bytes()


class TestMatFiles:
    """SciPy's reader trusts its input; these would crash it, or take memory without end."""

    def test_valid_file_is_read(self, valid):
        assert load(write(valid, "rig.mat")).format == "matlab"

    @settings(FUZZ, max_examples=300)
    @given(edits=st.lists(
        st.tuples(st.integers(128, 2600), st.one_of(st.binary(min_size=1, max_size=4), st.sampled_from(WORDS))),
        min_size=1, max_size=4))  # fmt: skip
    def test_file_with_any_bytes_changed_is_read_or_refused(self, valid, edits):
        content = bytearray(valid)
        for place, new in edits:
            content[place : place + len(new)] = new
        read_or_refused(write(bytes(content), "rig.mat"))

    def test_file_cut_off_anywhere_is_refused(self, valid):
        for length in range(20, len(valid) - 8, 61):
            refusal(write(valid[:length], "rig.mat"))

    def test_compressed_file_with_any_bytes_changed_is_read_or_refused(self):
        RIGS["bouguet"].write()
        with open("stereo.mat", "rb") as file:
            valid = file.read()
        rng = np.random.default_rng(1)
        for _ in range(100):
            content = bytearray(valid)
            content[128 + int(rng.integers(len(content) - 128))] ^= 1 << int(rng.integers(8))
            read_or_refused(write(bytes(content), "rig.mat"))

    @pytest.mark.parametrize("body, problem", [
        (lambda: element(15, zlib.compress(element(14, matrix("x", (1, 40 << 20), bytes(40 << 20)))[: 80 << 20])),
         "broken MAT-file: more than 16 MiB when unpacked"),
        (lambda: element(15, b"no zlib"), "broken MAT-file: Error -3 while decompressing data: incorrect header check"),
        (lambda: element(15, b""), "broken MAT-file: it ends within an element"),
        (lambda: element(14, nested(5000)), "broken MAT-file: nested more than 6 deep"),
        (lambda: element(15, zlib.compress(element(14, nested(100_000)))), "broken MAT-file: nested more than 6 deep"),
        (lambda: element(14, matrix("x", (1 << 30, 1 << 30), bytes(8))),
         "broken MAT-file: 8 bytes for 1152921504606846976 values"),
        (lambda: element(14, cells((1 << 20, 1 << 20))), "broken MAT-file: more cells than the file has bytes for"),
        (lambda: element(14, matrix("x", (-1, 1), bytes(8))), "broken MAT-file: dimensions [-1, 1]"),
        (lambda: element(14, matrix("x", (1,) * 20, bytes(8))),
         "broken MAT-file: dimensions [1, 1, 1, 1, 1, 1, 1, 1, 1]"),
        (lambda: element(14, matrix("x", (1, 1), bytes(8), kind=77)), "broken MAT-file: an array of class 77"),
        (lambda: element(14, matrix("x", (1, 1), bytes(8), stored=19)), "broken MAT-file: values of type 19"),
        (lambda: element(14, matrix("x", (1, 2), bytes(8))), "broken MAT-file: 8 bytes for 2 values"),
        (lambda: element(1, bytes(8)), "broken MAT-file: an element of type 1 where a variable is due"),
        (lambda: b"".join(element(14, matrix(f"x{n}", (1, 1), bytes(8))) for n in range(6000)),
         "broken MAT-file: more than 20000 elements"),
    ])  # fmt: skip
    def test_hostile_file_is_refused_at_once_and_with_little_memory(self, body, problem):
        path = write(header() + body(), "rig.mat")
        assert os.path.getsize(path) < 1 << 20
        tracemalloc.start()
        start = time.process_time()
        message = refusal(path)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert message == f"rig.mat: {problem}"
        assert time.process_time() - start < SECONDS
        assert peak < 64 << 20

    @pytest.mark.parametrize("kind", [3, 17])
    def test_objects_are_left_alone_and_advice_is_given(self, kind):
        path = write(header() + element(14, matrix("stereoParams", (1, 1), bytes(8), kind=kind)), "rig.mat")
        assert refusal(path) == (
            "rig.mat: CameraParameters1: missing: it holds a MATLAB object; "
            "save the struct instead: s = toStruct(stereoParams)"
        )

    def test_foreign_variables_beside_the_calibration_do_no_harm(self, valid):
        foreign = b"".join(element(14, matrix(f"v{kind}", (1, 1), bytes(8), kind=kind)) for kind in (3, 5, 16, 17))
        assert load(write(valid + foreign, "rig.mat")).T[0] == -0.06

    @pytest.mark.parametrize("content", [
        b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + bytes(512) + b"\x89HDF\r\n\x1a\n", b"MATLAB ",
        b"MATLAB 5.0 MAT-fil",
    ])  # fmt: skip
    def test_other_versions_are_refused_with_advice(self, content):
        message = "rig.mat: not a MAT-file of version 5 to 7.2; in MATLAB: save(..., '-v7')"
        assert refusal(write(content, "rig.mat")) == message

    def test_big_endian_files_are_walked_too(self):
        values = struct.pack(">d", 1.0)
        content = b"".join([
            struct.pack(">II", 6, 8), struct.pack(">II", 6, 0), struct.pack(">II", 5, 8), struct.pack(">ii", 1, 1),
            struct.pack(">II", 1, 8), b"fc_left\0", struct.pack(">II", 9, 8), values,
        ])  # fmt: skip
        path = write(header(">") + struct.pack(">II", 14, len(content)) + content, "rig.mat")
        assert refusal(path, format="bouguet") == "rig.mat: om: missing"


def header(order="<"):
    mark = b"IM" if order == "<" else b"MI"
    return b"MATLAB 5.0 MAT-file, made by hand".ljust(124) + struct.pack(order + "H", 0x100) + mark


def element(kind, content):
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8 if kind != 15 else 0)


def matrix(name, dims, values, kind=6, stored=9):
    start = element(6, struct.pack("<II", kind, 0)) + element(5, struct.pack(f"<{len(dims)}i", *dims))
    return start + element(1, name.encode()) + element(stored, values)


def cells(dims, content=b""):
    return element(6, struct.pack("<II", 1, 0)) + element(5, struct.pack("<2i", *dims)) + element(1, b"c") + content


def nested(depth):
    start = element(6, struct.pack("<II", 1, 0)) + element(5, struct.pack("<2i", 1, 1)) + element(1, b"")
    content = b""
    parts, size = [], 0
    for _ in range(depth):
        parts.append((start, size))
        size += len(start) + 8
    return b"".join(start + struct.pack("<II", 14, size) for start, size in reversed(parts)) + content
