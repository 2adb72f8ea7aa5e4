"""What the files of DepthAI, ZED and MYNT EYE cameras mean: directions, units, choices, and what is refused."""

import copy
import json

import numpy as np
import pytest
from calibration_files import refusal, transform, turn, write
from format_files import ZED_TOOL, depthai, mynt, zed, zed_tool
from rig_numbers import MYNT, OAKD, ZED

from hdl.calibration import load
from hdl.errors import InputError


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


class TestDepthai:
    def test_lengths_become_metres(self):
        rig = load(write(depthai()))
        assert rig.T.tolist() == [length / 100 for length in OAKD[1]["T"]]
        assert rig.left.D.size == 14 and rig.left.model == "rational"

    @pytest.mark.parametrize("select", ["1,2", "CAM_B,CAM_C", "left,right", " cam_b , 2"])
    def test_sockets_can_be_named_in_several_ways(self, select):
        content = write(depthai(left=0, right=0))
        assert "stereoRectificationData.leftCameraSocket" in refusal(content)
        assert load(content, select=select).left.K[0, 0] == OAKD[1]["K"][0][0]

    def test_motion_is_chained_over_other_sockets(self):
        sockets = copy.deepcopy(OAKD)
        sockets[0]["size"] = [1280, 800]
        sockets[0]["K"] = sockets[1]["K"]
        to_right, to_centre = (transform(OAKD[socket]["R"], OAKD[socket]["T"]) for socket in (1, 2))
        expected = to_centre @ to_right
        rig, back = (load(write(depthai(sockets)), select=select) for select in ("1,0", "0,1"))
        assert np.abs(rig.R - expected[:3, :3]).max() < 1e-6
        assert np.abs(rig.T - expected[:3, 3] / 100).max() < 1e-8
        assert np.abs(back.R - rig.R.T).max() < 1e-15

    def test_fisheye_has_four_coefficients(self):
        sockets = copy.deepcopy(OAKD)
        for socket in sockets.values():
            socket["D"] = [0.1, 0.02, 0.003, 0.0004]
        rig = load(write(depthai(sockets, kind=1)))
        assert (rig.left.model, rig.left.D.tolist()) == ("equidistant", [0.1, 0.02, 0.003, 0.0004])
        assert "four coefficients that are not zero" in refusal(write(depthai(kind=1)))

    @pytest.mark.parametrize("change, message", [
        (lambda c: c["cameraData"][2][1].update(width=0), "cameraData[2].width, height = 0x800: an image size must "),
        (lambda c: c["cameraData"][1][1].update(cameraType=3), "cameraData[1].cameraType = 3: radial division images"),
        (lambda c: c["cameraData"][1][1].update(cameraType="x"), "cameraData[1].cameraType = x: 0 (perspective) or"),
        (lambda c: c["cameraData"][1][1].update(cameraType=True), "cameraData[1].cameraType = True: 0 (pers"),
        (lambda c: c["cameraData"][1][1].pop("intrinsicMatrix"), "cameraData[1].intrinsicMatrix: missing"),
        (lambda c: c["cameraData"].append(c["cameraData"][0]), "cameraData = 0: the socket is given twice"),
        (lambda c: c.update(cameraData={}), "cameraData = {}: a list of pairs of socket and camera is needed"),
        (lambda c: c["cameraData"][1][1]["extrinsics"].update(toCameraSocket=-1),
         "cameraData[1].extrinsics.toCameraSocket: no chain of extrinsics leads from 1 to 2"),
        (lambda c: c["cameraData"][1][1]["extrinsics"]["translation"].update(x=True),
         "cameraData[1].extrinsics.translation.x = True: not a finite number"),
    ])  # fmt: skip
    def test_bad_fields_are_named(self, change, message):
        content = json.loads(depthai({socket: OAKD[socket] for socket in (0, 1, 2)}))
        content["cameraData"][2][1]["extrinsics"]["toCameraSocket"] = -1
        change(content)
        assert refusal(write(json.dumps(content))).startswith(f"rig.yml: {message}")


class TestZed:
    def test_baseline_is_a_length_and_ty_and_tz_are_those_of_t(self):
        sections = copy.deepcopy(ZED)
        sections["STEREO"] |= {"TY": "0.3", "TZ_HD": "-0.2"}
        rig = load(write(zed(sections)), select="hd")
        assert rig.T == pytest.approx([-0.12, 0.0003, -0.0002], abs=1e-15)
        assert rig.R == pytest.approx(turn(0.00612931, 0.006799, -0.00194124), abs=1e-15)

    @pytest.mark.parametrize("options, size, fx", [
        ({}, (2208, 1242), 1401.79), ({"select": "VGA"}, (672, 376), 350.4475), ({"size": (1920, 1080)}, (1920, 1080),
        1401.79), ({"select": "HD", "size": (640, 360)}, (640, 360), 350.4475),
    ])  # fmt: skip
    def test_resolution_is_that_of_the_size_or_named(self, options, size, fx):
        rig = load(write(zed()), **options)
        assert ((rig.width, rig.height), rig.left.K[0, 0]) == (size, fx)

    def test_first_resolution_serves_with_a_warning(self):
        expected = "rig.yml: LEFT_CAM_2K: the first of 2K, FHD, HD, VGA; choose another with --select or --size"
        assert load(write(zed())).warnings == (expected,)

    def test_other_sizes_ask_for_the_section_to_scale(self):
        assert refusal(write(zed()), size=(640, 480)) == (
            "--size: 640x480: no section for it in rig.yml: 2K (2208x1242), FHD (1920x1080), HD (1280x720), "
            "VGA (672x376); name the one to be scaled with --select"
        )
        assert refusal("rig.yml", select="4K") == "--select: 4K: the choice is between 2K, FHD, HD, VGA"

    def test_further_coefficients_make_a_rational_lens(self):
        sections = copy.deepcopy(ZED)
        for side in ("LEFT", "RIGHT"):
            sections[f"{side}_CAM_HD"] |= {"k4": "0.1", "k5": "0.2", "k6": "0.3"}
        rig = load(write(zed(sections)), select="HD")
        assert rig.left.D.tolist() == [-0.175995, 0.0265533, 0, 0, 0, 0.1, 0.2, 0.3]

    @pytest.mark.parametrize("section, key, value, message", [
        ("LEFT_CAM_HD", "fx", "wide", "LEFT_CAM_HD.fx = wide: not a finite number"),
        ("RIGHT_CAM_HD", "k2", None, "RIGHT_CAM_HD.k2: missing"),
        ("RIGHT_CAM_HD", "p2", None, "RIGHT_CAM_HD.p2: missing"),
        ("RIGHT_CAM_HD", None, None, "RIGHT_CAM_HD: the section is missing"),
        ("STEREO", None, None, "STEREO: the section is missing"),
        ("STEREO", "Baseline", None, "STEREO.baseline: missing"),
        ("STEREO", "RX_HD", "7", "STEREO.RX, CV, RZ_HD = [7.0, 0.006799, -0.00194124]: angles in rad are needed"),
        ("LEFT_CAM_HD", "s1", "1", "LEFT_CAM_HD.s2: missing"),
        ("LEFT_CAM_HD", "k6", "1", "LEFT_CAM_HD.k4: missing"),
    ])  # fmt: skip
    def test_bad_fields_are_named(self, section, key, value, message):
        sections = copy.deepcopy(ZED)
        if key is None:
            del sections[section]
        elif value is None:
            del sections[section][key]
        else:
            sections[section][key] = value
        assert refusal(write(zed(sections)), select="HD") == f"rig.yml: {message}"

    def test_repeated_and_shapeless_lines_are_refused(self):
        assert refusal(write(zed() + "Baseline=3\n")) == "rig.yml: STEREO.baseline: given twice, again in line 105"
        assert refusal(write(zed() + "[STEREO]\n")) == "rig.yml: STEREO: given twice, again in line 105"
        shapeless = "not of the form KEY=VALUE in a [SECTION]"
        assert refusal(write(zed() + "oops\n")) == f"rig.yml: line 105 = oops: {shapeless}"
        assert refusal(write("fx=1\n" + zed())) == f"rig.yml: line 1 = fx=1: {shapeless}"

    @pytest.mark.parametrize("name, size", [("4k", (3840, 2160)), ("QHDPLUS", (3200, 1800))])
    def test_sections_of_the_4k_cameras_are_known(self, name, size):
        sections = {
            f"{side}_CAM_{name}": ZED[f"{side}_CAM_2K"] | {"cx": str(size[0] / 2), "cy": str(size[1] / 2)}
            for side in ("LEFT", "RIGHT")
        }
        stereo = {f"{axis}_{name}": ZED["STEREO"][f"{axis}_2K"] for axis in ("RX", "CV", "RZ")}
        path = write(zed(sections | {"STEREO": {"Baseline": "120", **stereo}}))
        for options in ({}, {"select": name}, {"size": size}):
            rig = load(path, **options)
            assert ((rig.width, rig.height), rig.left.K[0, 2]) == (size, size[0] / 2)

    @pytest.mark.parametrize("gone, D", [
        (("k3",), [-0.17, 0.02, 0.001, 0.002]), (("k3", "p1", "p2"), [-0.17, 0.02, 0, 0]),
        (("p1", "p2"), [-0.17, 0.02, 0, 0, 0.003]),
    ])  # fmt: skip
    def test_first_cameras_lack_coefficients_and_places(self, gone, D):
        sections = copy.deepcopy(ZED)
        for side in ("LEFT", "RIGHT"):
            camera = sections[f"{side}_CAM_HD"]
            camera |= {"k1": "-0.17", "k2": "0.02", "k3": "0.003", "p1": "0.001", "p2": "0.002"}
            for key in gone:
                del camera[key]
        del sections["STEREO"]["TY"], sections["STEREO"]["TZ"]
        rig = load(write(zed(sections)), select="HD")
        assert (rig.left.model, rig.left.D.tolist(), rig.T.tolist()) == ("radtan", D, [-0.12, 0, 0])
        assert rig.warnings == ()


class TestZedDisto:
    """The lens of all resolutions in sections of its own."""

    EIGHT = dict(zip("k1 k2 p1 p2 k3 k4 k5 k6".split(), "0.3 0.05 2e-4 -1e-4 0.002 0.33 0.09 0.009".split()))
    FISHEYE = {"k1": "0.02", "k2": "-0.005", "k3": "0.001", "k4": "-0.0002"}

    def read(self, left, right=None, beside=()):
        """``beside``: the coefficients in the sections of the cameras."""
        sections = copy.deepcopy(ZED)
        for camera in (content for name, content in sections.items() if "_CAM_" in name):
            for key in set(self.EIGHT) & set(camera) - set(beside):
                del camera[key]
        return load(write(zed(sections | {"LEFT_DISTO": left, "RIGHT_DISTO": right or left})), select="HD")

    def test_is_that_of_every_resolution(self):
        rig = self.read(self.EIGHT)
        assert rig.left.D.tolist() == rig.right.D.tolist() == [0.3, 0.05, 2e-4, -1e-4, 0.002, 0.33, 0.09, 0.009]
        assert rig.left.model == "rational" and not [line for line in rig.warnings if "DISTO" in line]
        assert rig.fields["D2"] == ("rig.yml", "RIGHT_DISTO") and rig.fields["K2"] == ("rig.yml", "RIGHT_CAM_HD")

    def test_goes_before_the_one_beside_it_and_it_is_said(self):
        rig = self.read(self.EIGHT, beside=("k1", "k2", "p1"))
        assert rig.left.D.size == 8
        assert rig.warnings[:2] == tuple(
            f"rig.yml: {side}_DISTO: taken, and not the lens in {side}_CAM_HD, as the SDK does from version 3.5 on"
            for side in ("LEFT", "RIGHT")
        )

    @pytest.mark.parametrize("more", [{}, {"p1": "0", "p2": "0"}, dict.fromkeys(("k5", "k6", "p1", "p2"), "0")])
    def test_with_k1_to_k4_alone_is_of_a_fisheye(self, more):
        rig = self.read(self.FISHEYE | more, self.FISHEYE | more | {"k1": "0.021"})
        assert (rig.left.model, rig.right.model) == ("equidistant", "equidistant")
        assert (rig.left.D.tolist(), rig.right.D[0]) == ([0.02, -0.005, 0.001, -0.0002], 0.021)
        assert rig.warnings == ()

    @pytest.mark.parametrize("change", [{"k4": "0"}, {"p2": "1e-5"}, {"k6": "0.1"}])
    def test_with_all_eight_is_of_a_fisheye_only_as_the_sdk_takes_it_for_one(self, change):
        padded = self.FISHEYE | dict.fromkeys(("k5", "k6", "p1", "p2"), "0") | change
        assert self.read(padded).left.model in ("radtan", "rational")

    def test_missing_coefficient_is_named(self):
        gone = {key: value for key, value in self.EIGHT.items() if key != "k5"}
        with pytest.raises(InputError, match=r"^rig\.yml: LEFT_DISTO\.k5: missing$"):
            self.read(gone)


class TestZedTool:
    def test_lengths_become_metres_and_r_is_a_vector(self):
        rig = load(write(zed_tool((960, 600), *ZED_TOOL)))
        assert rig.T == pytest.approx([-0.11987, 0.00142, -0.00231], abs=1e-15)
        assert rig.R == pytest.approx(turn(0.0031, -0.0052, 0.0017), abs=1e-15)
        assert (rig.unit, rig.left.model, rig.right.D[0]) == ("m", "rational", 0.33)

    def test_fisheye_has_fields_of_its_own(self):
        cameras = [(K, [0.02, -0.005, 0.001, -0.0002]) for K, _ in ZED_TOOL[0]]
        rig = load(write(zed_tool((960, 600), cameras, *ZED_TOOL[1:], fisheye=True)))
        assert (rig.left.model, rig.right.model, rig.warnings) == ("equidistant", "equidistant", ())

    @pytest.mark.parametrize("old, new, message", [
        ("K_RIGHT", "K_WRONG", "K_RIGHT: missing"), ("D_RIGHT", "D_WRONG", "D_RIGHT: missing"),
        ("960, 600", "960", "Size = 1 values: 2 numbers are needed"),
        ("0.0031, -0.0052", "31., -0.0052", "R = [31.0, -0.0052, 0.0017]: a rotation vector in rad is needed"),
    ])  # fmt: skip
    def test_bad_fields_are_named(self, old, new, message):
        assert refusal(write(zed_tool((960, 600), *ZED_TOOL).replace(old, new))) == f"rig.yml: {message}"


class TestMynt:
    def test_lengths_become_metres_and_the_name_of_the_field_is_not_its_direction(self):
        rig = load(write(mynt((MYNT["size"], "pinhole", *MYNT["pinhole"]))))
        assert rig.T.tolist() == [length / 1000 for length in MYNT["translation"]]
        assert np.abs(rig.R.ravel() - MYNT["rotation"]).max() < 1e-15

    def test_equidistant_coefficients_hold_the_camera_matrix(self):
        rig = load(write(mynt((MYNT["size"], "equidistant", *MYNT["equidistant"]))))
        k2, k3, k4, k5, mu, mv, u0, v0 = MYNT["equidistant"][0]
        assert rig.left.D.tolist() == [k2, k3, k4, k5]
        assert rig.left.K.tolist() == [[mu, 0, u0], [0, mv, v0], [0, 0, 1]]

    def test_resolution_is_that_of_the_size_or_named(self):
        left, right = MYNT["pinhole"]
        twice = [[2 * number for number in camera[:4]] + camera[4:] for camera in (left, right)]
        path = write(mynt(((752, 480), "pinhole", left, right), ((1504, 960), "pinhole", *twice)))
        assert load(path).warnings == (
            "rig.yml: img_params[0].width, height = 752x480: "
            "the first of 752x480, 1504x960; choose another with --select or --size",
        )
        assert load(path, select="1504x960").left.K[0, 0] == 2 * left[0]
        assert load(path, size=(1504, 960)).left.K[0, 0] == 2 * left[0]
        assert load(path, size=(376, 240)).left.K[0, 0] == left[0] / 2
        assert refusal(path, select="640x480") == "--select: 640x480: the choice is between 752x480, 1504x960"

    def test_numbers_copied_from_another_resolution_are_refused(self):
        """The equidistant ones of the malformed S210A: those of a 752x480 camera, for 640x400 and for 1280x800."""
        cameras = MYNT["equidistant"]
        path = write(mynt(((640, 400), "equidistant", *cameras), ((1280, 800), "equidistant", *cameras)))
        fits_not = "copied: the same numbers stand for {}, and do not fit here"
        for options, start, other in (
            ({}, "img_params[0].in_left = centre 374.15, 231.25 of 640x400", "1280x800"),
            ({"select": "1280x800"}, "img_params[1].in_left = centre 374.15, 231.25 of 1280x800", "640x400"),
        ):
            assert refusal(path, **options) == f"rig.yml: {start}: {fits_not.format(other)}"

    @pytest.mark.parametrize("text, message", [
        ("img_params: 5", "img_params = 5: a list of resolutions is needed"),
        ("img_params: []", "img_params = []: a list of resolutions is needed"),
        ("img_params: [ 1 ]", "img_params[0] = 1: named fields are needed here"),
        ("img_params:\n -\n  model: 0\n  width: 640\n", "img_params[0].height: missing"),
    ])  # fmt: skip
    def test_shapeless_files_are_refused(self, text, message):
        assert refusal(write(text)) == f"rig.yml: {message}"
