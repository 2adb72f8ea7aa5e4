"""Lens models other than OpenCV's: under which names and in which fields files have them, and what is refused."""

import cv2
import numpy as np
import pytest
from calibration_files import RIG, as_yaml, refusal, turn, write
from format_files import RIGS, euroc, kalibr
from rig_numbers import ASL, OAKD, OCAM, WIDE

from hdl.calibration import Camera, Rig, checks, convert, lenses, load
from hdl.errors import InputError


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def chain(name, *changes, **options):
    """Kalibr's file of one of WIDE; ``changes`` to the fields of the first, second camera, ``options`` to the whole."""
    rig = WIDE[name] | options
    cameras = [camera | change for camera, change in zip(rig["cameras"], (*changes, {}, {}))]
    return write(kalibr(rig["size"], cameras, rig["lens"], rig["model"]), "chain.yaml")


@pytest.mark.parametrize("name, model", [
    ("tum_vi_ds", "double_sphere"), ("euroc_eucm", "eucm"), ("kalibr_omni", "mei"), ("mynteye_fov", "fov"),
])  # fmt: skip
def test_kalibr_has_what_is_the_projections_own_before_the_focal_lengths(name, model):
    rig = load(chain(name))
    for camera, given in zip((rig.left, rig.right), WIDE[name]["cameras"]):
        *own, fu, fv, pu, pv = given["intrinsics"]
        assert (camera.model, camera.D.tolist()) == (model, [*own, *given["D"]])
        assert camera.K.tolist() == [[fu, 0, pu], [0, fv, pv], [0, 0, 1]]
    assert rig.T.tolist() == [row[3] for row in WIDE[name]["cameras"][1]["T_cn_cnm1"][:3]]
    assert not rig.warnings


def test_omni_may_have_no_distortion():
    rig = load(chain("kalibr_omni", {"D": []}, {"D": []}, lens="none"))
    assert (rig.left.model, rig.left.D.tolist()) == ("mei", [0.671111239995445])


def test_sensor_yaml_has_such_cameras_too():
    poses = [camera["T_BS"] for camera in ASL["euroc"]["cameras"]]
    cameras = WIDE["euroc_ds"]["cameras"]
    for number in (0, 1):
        text = euroc([752, 480], poses[number], cameras[number]["intrinsics"], [], "none", "ds")
        write(text, f"cam{number}.yaml")
    rig, expected = load("cam1.yaml", "cam0.yaml"), load(chain("euroc_ds"))
    assert rig.left.D.tolist() == expected.left.D.tolist() and rig.right.model == "double_sphere"
    assert np.linalg.norm(rig.T) == pytest.approx(np.linalg.norm(expected.T), rel=1e-3)


def test_radtan_of_eight_coefficients_has_opencvs_order():
    cameras = []
    for socket in (1, 2):
        (fu, _, pu), (_, fv, pv), _ = OAKD[socket]["K"]
        cameras.append({"intrinsics": [fu, fv, pu, pv], "D": OAKD[socket]["D"]})
    cameras[1]["T_cn_cnm1"] = np.vstack([np.column_stack([OAKD[1]["R"], OAKD[1]["T"]]), [0, 0, 0, 1]])
    rig, device = load(write(kalibr([1280, 800], cameras, "radtan8"))), load(*RIGS["oakd"].write())
    for side in ("left", "right"):
        assert rig.camera(side).model == device.camera(side).model == "rational"
        assert rig.camera(side).D.tolist() == device.camera(side).D[:8].tolist()


@pytest.mark.parametrize("name, model, count", [
    ("pinhole-radtan8", "rational", 8), ("radtan4", "radtan", 4), ("RadialTangential8", "rational", 8),
    ("kb4", "equidistant", 4), ("KannalaBrandt8", "equidistant", 4), ("KANNALA_BRANDT", "equidistant", 4),
    ("pinhole-equi", "equidistant", 4), ("pinhole", "radtan", 0), ("none", "radtan", 0),
    ("ds", "double_sphere", 2), ("double_sphere", "double_sphere", 2), ("Double-Sphere", "double_sphere", 2),
    ("eucm", "eucm", 2), ("ucm", "eucm", 2), ("MEI", "mei", 5), ("omni", "mei", 5), ("unified", "mei", 5),
    ("omnidir", "mei", 5), ("fov", "fov", 1), ("ATAN", "fov", 1), ("pinhole-fov", "fov", 1),
    ("SCARAMUZZA", "scaramuzza", 15), ("ocam", "scaramuzza", 15),
])  # fmt: skip
def test_names_that_programs_give_to_lenses(name, model, count):
    assert lenses.model("f", "lens", name, np.full(count, 0.1)) == model


@pytest.mark.parametrize(
    "name", ["equirectangular", "radial_division", "ftheta", "none", "pinhole", "", 4, None, ["ds"]]
)
def test_other_lenses_are_refused_by_their_names(name):
    with pytest.raises(InputError) as caught:
        lenses.model("f", "lens", name, np.full(2, 0.1))
    assert str(caught.value).endswith(
        "the lens models known are radtan, rational, thin_prism, tilted, equidistant, double_sphere, eucm, mei, fov, "
        "scaramuzza"
    )


@pytest.mark.parametrize("name, options, message", [
    ("tum_vi_ds", {"lens": "radtan"}, "cam0.distortion_model = radtan: ds is understood with none"),
    ("kalibr_omni", {"lens": "equidistant"}, "cam0.distortion_model = equidistant: omni is understood with radtan or "
                                             "none"),
    ("euroc_eucm", {"model": "pinhole"}, "cam0.intrinsics = 6 values: 4 numbers are needed"),
    ("tum_vi_ds", {"model": "omni"}, "cam0.intrinsics = 6 values: 5 numbers are needed"),
    ("kalibr_omni", {"model": "ds"}, "cam0.intrinsics = 5 values: 6 numbers are needed"),
    ("mynteye_fov", {"lens": "equidistant"}, "cam0.distortion_coeffs = 1 coefficients: a lens of model equidistant "
                                             "has 4"),
])  # fmt: skip
def test_projections_and_distortions_that_do_not_belong_together_are_refused(name, options, message):
    assert refusal(chain(name, **options)) == f"chain.yaml: {message}"


@pytest.mark.parametrize("name, change, message", [
    ("tum_vi_ds", {"intrinsics": [0.1, 1.2, 158, 158, 255, 255]},
     "cam0.intrinsics = alpha 1.2: in a lens of model double_sphere it lies between 0 and 1"),
    ("euroc_eucm", {"intrinsics": [0.6, -1.1, 460, 460, 366, 249]},
     "cam0.intrinsics = beta -1.1: in a lens of model eucm it lies between 0 and 100"),
    ("kalibr_omni", {"intrinsics": [-1, 770, 770, 362, 247]},
     "cam0.intrinsics, distortion_coeffs = xi -1: in a lens of model mei it lies between -0.99 and 100"),
    ("mynteye_fov", {"D": [55.1]},
     "cam0.distortion_coeffs = w 55.1: in a lens of model fov it lies between 0 and 3.1"),
])  # fmt: skip
def test_coefficients_that_make_no_lens_are_named(name, change, message):
    assert refusal(chain(name, change)) == f"chain.yaml: {message}"


def test_kimeras_omni_is_called_what_it_is():
    rig = ASL["euroc"]
    for index, camera in enumerate(rig["cameras"]):
        text = euroc(rig["size"], camera["T_BS"], [], [-206.5, 0, 0.0022, -4.9e-6, 1.9e-8], "omni", "omni")
        write(text + "\nomni_affine: [1, 0, 0]\nomni_distortion_center: [394, 241]\n", f"cam{index}.yaml")
    assert refusal("cam0.yaml", "cam1.yaml") == (
        "cam0.yaml: camera_model = omni: Scaramuzza's polynomial from the image to the ray; "
        "the inverse polynomial of OCamCalib is needed"
    )


D = (1, 4, ["-0.25", "0.0625", "1.e-003", "-5.e-04"])


class TestOmnidir:
    """What cv::omnidir calibrates, in the words of OpenCV's sample and of others."""

    def test_xi_makes_the_lens_meis(self):
        rig = load(write(as_yaml(RIG | {"D1": D, "D2": D, "xi1": 1.25, "xi2": 1.5})))
        assert (rig.left.model, rig.left.D.tolist()) == ("mei", [1.25, -0.25, 0.0625, 1e-3, -5e-4])
        assert rig.right.D[0] == 1.5

    def test_xi_may_be_a_matrix(self):
        rig = load(write(as_yaml(RIG | {"D1": D, "D2": D, "XI1": (1, 1, ["1.25"]), "XI2": (1, 1, ["1.5"])})))
        assert (rig.left.D[0], rig.right.D[0]) == (1.25, 1.5)

    def test_the_sample_has_the_motion_as_rotation_vector_and_t(self):
        names = {"M1": "camera_matrix_1", "M2": "camera_matrix_2"}
        fields = {names[key]: RIG[key] for key in names}
        fields |= {"distortion_coefficients_1": D, "distortion_coefficients_2": D, "xi_1": 1.25, "xi_2": 1.5}
        fields["extrinsic_parameters"] = 1, 6, ["0.01", "-0.02", "0.03", "-100.", "1.5", "-0.5"]
        path = write(as_yaml(fields))
        rig = load(path, size=(640, 480))
        assert rig.R == pytest.approx(turn(0.01, -0.02, 0.03), abs=1e-14) and rig.T.tolist() == [-100, 1.5, -0.5]
        assert rig.fields["T"] == ("rig.yml", "extrinsic_parameters") and rig.left.model == "mei"

    @pytest.mark.parametrize("xi, message", [
        ({"xi": 1.2}, "xi = 1.2: of which camera? an omnidirectional pair has xi1 and xi2"),
        ({"xi1": 1.2}, "xi2 or XI2: missing"),
        ({"xi1": ".Nan", "xi2": 1}, "xi1[0] = nan: not a finite number"),
        ({"xi1": 1.2, "xi2": "none"}, "xi2 = none: a matrix with rows, cols, dt and data, or a sequence, is needed"),
        ({"xi1": 1.2, "xi2": -3}, "D2 = xi -3: in a lens of model mei it lies between -0.99 and 100"),
    ])  # fmt: skip
    def test_xi_that_cannot_be_used_is_named(self, xi, message):
        assert refusal(write(as_yaml(RIG | {"D1": D, "D2": D} | xi))) == f"rig.yml: {message}"

    def test_more_than_four_coefficients_are_refused(self):
        expected = "rig.yml: D1 = 6 coefficients: a lens of model mei has 1 or 5"
        assert refusal(write(as_yaml(RIG | {"xi1": 1.2, "xi2": 1.3}))) == expected


class TestScaramuzza:
    camera = lenses.scaramuzza_camera(OCAM["inverse"], OCAM["affine"], OCAM["centre"])

    def rig(self, width=752, height=480, **change):
        camera = Camera(**(vars(self.camera) | change))
        return Rig("ocam.yml", width, height, camera, camera, np.eye(3), np.array([-0.1, 0, 0]))

    def test_the_focal_length_is_that_on_the_optical_axis(self):
        # Of the polynomial that the inverse one was fitted to, -206.517 + 0.0022 rho^2 ..., it is 206.517.
        assert self.camera.K[0, 0] == self.camera.K[1, 1] == pytest.approx(206.517, abs=0.5)
        assert self.camera.K[:2, 2].tolist() == OCAM["centre"]

    def test_it_survives_scaling_and_opencvs_format(self):
        rig = self.rig().scaled(376, 240)
        again = load(write(convert.to_opencv(rig)))
        assert again.left.model == "scaramuzza" and np.array_equal(again.left.K, rig.left.K)
        assert np.array_equal(again.right.D, self.camera.D)

    def test_one_without_an_image_of_its_axis_is_refused(self):
        # A panoramic annular lens, which sees 40 to 120 degrees from its axis (LF-VIO).
        inverse = [376.845565, 246.746504, 19.035187, 23.840497, 18.991943, 6.066253, 1.560387, 5.854280, 3.458320,
                   -1.995166, -1.509264, 1.089614, 1.340245, 0.255323]  # fmt: skip
        panoramic = lenses.scaramuzza_camera(inverse, [1, 0, 0], [645.1, 486.0])
        with pytest.raises(InputError) as caught:
            checks.check(self.rig(1280, 960, **vars(panoramic)))
        assert str(caught.value) == (
            "ocam.yml: K1 = fx -125.232: singular or mirrored: a focal length must be positive"
        )


@pytest.mark.parametrize("name, fields", [
    ("tum_vi_ds", {"model": "double_sphere", "lens1": WIDE["tum_vi_ds"]["cameras"][0]["intrinsics"][:2]}),
    ("mynteye_fov", {"model": "fov", "lens1": WIDE["mynteye_fov"]["cameras"][0]["D"]}),
    ("kalibr_omni", {"model": "mei", "xi1": 0.671111239995445, "D1": WIDE["kalibr_omni"]["cameras"][0]["D"]}),
])  # fmt: skip
def test_opencv_finds_no_lens_in_d_but_its_own(name, fields):
    storage = cv2.FileStorage(write(convert.to_opencv(load(chain(name)))), cv2.FileStorage_READ)
    assert storage.getNode("D1").empty() == ("D1" not in fields)
    for field, value in fields.items():
        node = storage.getNode(field)
        found = node.string() if node.isString() else node.real() if node.isReal() else node.mat().ravel().tolist()
        assert found == value


def test_two_kinds_of_lenses_have_no_common_file():
    rig = load(chain("mynteye_fov"))
    mixed = Rig("f", 752, 480, rig.left, Camera("radtan", rig.right.K, np.zeros(0)), rig.R, rig.T)
    with pytest.raises(InputError) as caught:
        convert.to_opencv(mixed)
    assert str(caught.value) == "f: lens models = fov, radtan: OpenCV's format holds one kind for both cameras"


def test_tangential_terms_are_looked_for_where_the_model_has_them():
    coefficients = [-0.35, 0.16, 0.2, 0.001]
    (warning,) = load(chain("kalibr_omni", {"D": coefficients})).warnings
    assert warning.endswith("large tangential terms: OpenCV's order xi, k1, k2, p1, p2 is meant")
    assert not load(chain("tum_vi_ds")).warnings
