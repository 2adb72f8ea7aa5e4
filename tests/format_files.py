"""Calibration files of every format, with the numbers of real rigs, in the words of the programs that write them."""

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from calibration_files import as_yaml
from rig_numbers import ASL, BOUGUET, KITTI, MRPT, MYNT, OAKD, ORBSLAM, ROS, TUM_VI, UNLOOK_1280, UNLOOK_1456, WIDE, ZED
from scipy.io import savemat

SHARED = Path(__file__).resolve().parents[2] / "shared" / "data"
needs_shared_data = pytest.mark.skipif(not SHARED.is_dir(), reason="the reference data, ../shared/data, is not here")


@dataclass(frozen=True)
class Files:
    """``contents``: name to text, or to the variables of a MAT-file. ``real``: the files they follow, under ../shared.
    ``options``: of load."""

    contents: dict
    real: tuple[str, ...] = ()
    options: dict = field(default_factory=dict)

    def write(self, folder="."):
        """The paths of the files, written into ``folder``."""
        for name, content in self.contents.items():
            path = Path(folder) / name
            path.parent.mkdir(parents=True, exist_ok=True)
            if isinstance(content, dict):
                savemat(path, content, do_compression=True)
            else:
                path.write_text(content)
        return [Path(folder) / name for name in self.contents]

    @property
    def shared(self):
        return [SHARED / "rigs" / name for name in self.real]


def ros(size, K, D, R, P, name="narrow_stereo/left", model="plumb_bob"):
    matrices = {
        "camera_matrix": (3, 3, K), "distortion_coefficients": (1, len(D), D), "rectification_matrix": (3, 3, R),
        "projection_matrix": (3, 4, P),
    }  # fmt: skip
    lines = [f"image_width: {size[0]}", f"image_height: {size[1]}"]
    lines += [f"camera_name: {name}", f"distortion_model: {model}"]
    for key, (rows, cols, data) in matrices.items():
        lines.append(f"{key}:\n  rows: {rows}\n  cols: {cols}\n  data: {list(data)}")
    return "\n".join(lines) + "\n"


def euroc(size, T_BS, intrinsics, D, lens="radial-tangential", camera="pinhole"):
    return (
        "# General sensor definitions.\nsensor_type: camera\ncomment: cam (MT9M034)\n\n"
        f"T_BS:\n  cols: 4\n  rows: 4\n  data: {T_BS}\n\nrate_hz: 20\nresolution: {size}\ncamera_model: {camera}\n"
        f"intrinsics: {intrinsics} #fu, fv, cu, cv\ndistortion_model: {lens}\ndistortion_coefficients: {D}"
    )


def kalibr(size, cameras, lens="radtan", model="pinhole", header=""):
    """``cameras``: dicts with intrinsics, D and any of T_cam_imu, T_imu_cam and T_cn_cnm1, in 4 rows or 16 numbers."""
    lines = [header] if header else []
    for index, camera in enumerate(cameras):
        lines.append(f"cam{index}:")
        for key in ("T_cam_imu", "T_imu_cam", "T_cn_cnm1"):
            if key in camera:
                rows = "\n".join(f"  - {row}" for row in np.reshape(camera[key], (4, 4)).tolist())
                lines.append(f"  {key}: # a comment\n{rows}")
        lines += [
            f"  cam_overlaps: [{1 - index}]\n  camera_model: {model}\n  distortion_coeffs: {camera['D']}",
            f"  distortion_model: {lens}\n  intrinsics: {camera['intrinsics']}\n  resolution: {list(size)}",
            f"  rostopic: /cam{index}/image_raw",
        ]
    return "\n".join(lines) + "\n"


def kitti(entries=KITTI):
    lines = ["calib_time: 09-Jan-2012 13:57:47", "corner_dist: 9.950000e-02"]
    return "\n".join([*lines, *(f"{key}: {' '.join(values)}" for key, values in entries.items())]) + "\n"


def orbslam(entries=ORBSLAM):
    lines = ["%YAML:1.0\n", "Camera.fx: 435.2046959714599", "Camera.bf: 47.90639384423901", "Viewer.PointSize:2"]
    for key, value in entries.items():
        if isinstance(value, list):
            rows, cols, data = value
            space = "" if key.endswith(".D") else " "
            value = f"!!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data:{space}{data}"
        lines.append(f"{key}: {value}")
    return "\n".join(lines) + "\n"


def orbslam3(size, cameras, T_c1_c2, lens="KannalaBrandt8", changes=()):
    """``cameras``: dicts with intrinsics and D, the coefficients in ORB-SLAM3's order."""
    names = ("k1", "k2", "k3", "k4") if lens == "KannalaBrandt8" else ("k1", "k2", "p1", "p2", "k3")
    entries = {"File.version": '"1.0"', "Camera.type": f'"{lens}"'}
    for number, camera in enumerate(cameras, start=1):
        values = [*zip(("fx", "fy", "cx", "cy"), camera["intrinsics"]), *zip(names, camera["D"])]
        entries |= {f"Camera{number}.{name}": value for name, value in values}
    entries |= {"Camera.width": size[0], "Camera.height": size[1], "Camera2.overlappingEnd": size[0] - 1}
    entries["Stereo.T_c1_c2"] = f"!!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: f\n  data: {np.ravel(T_c1_c2).tolist()}"
    return "\n".join(["%YAML:1.0\n", *(f"{key}: {value}" for key, value in (entries | dict(changes)).items())]) + "\n"


def mynt(*blocks):
    """Of blocks ((width, height), "pinhole" or "equidistant", left, right)."""
    lines = ['%YAML:1.0\n---\nversion: "1.2"\nimg_params:']
    for (width, height), model, *cameras in blocks:
        lines.append(f"   -\n      model: {int(model == 'equidistant')}\n      width: {width}\n      height: {height}")
        for side, numbers in zip(("in_left", "in_right"), cameras):
            lines.append(f"      {side}:")
            if model == "pinhole":
                lines += [f"         {key}: {value}" for key, value in zip(("fx", "fy", "cx", "cy"), numbers)]
                numbers = numbers[4:]
            lines.append(f"         coeffs: {numbers}")
        lines.append(f"      ex_right_to_left:\n         rotation: {MYNT['rotation']}")
        lines.append(f"         translation: {MYNT['translation']}")
    return "\n".join(lines) + "\n"


def depthai(sockets=OAKD, left=1, right=2, kind=0):
    def camera(entry):
        xyz = dict(zip("xyz", entry["T"]))
        return {
            "cameraType": kind, "distortionCoeff": entry["D"] + [0.0] * (14 - len(entry["D"])),
            "extrinsics": {"rotationMatrix": entry["R"], "specTranslation": {"x": 0.0, "y": 0.0, "z": 0.0},
                           "toCameraSocket": entry["to"], "translation": xyz},
            "height": entry["size"][1], "width": entry["size"][0], "intrinsicMatrix": entry["K"],
        }  # fmt: skip

    data = [[socket, camera(entry)] for socket, entry in sockets.items()]
    stereo = {"leftCameraSocket": left, "rightCameraSocket": right}
    content = {"boardName": "BW1098OBC", "cameraData": data, "stereoRectificationData": stereo, "version": 6}
    return json.dumps(content, indent=4)


def zed(sections=ZED):
    texts = ["\n".join([f"[{name}]", *(f"{key}={value}" for key, value in entries.items())])
             for name, entries in sections.items()]  # fmt: skip
    return "\n\n".join(texts) + "\n"


def zed_tool(size, cameras, vector, T, fisheye=False):
    """As zed-opencv-calibration writes it; ``cameras``: K and D, ``vector``: of the rotation, rad, ``T``: in mm."""
    fields = {"Size": list(size)}
    for side, (K, D) in zip(("LEFT", "RIGHT"), cameras):
        fields[f"K_{side}"] = 3, 3, list(map(repr, np.ravel(K).tolist()))
        fields[f"D_{side}{'_FE' if fisheye else ''}"] = 1, len(D), list(map(repr, D))
    fields |= {name: (3, 1, list(map(repr, values))) for name, values in (("R", vector), ("T", T))}
    return as_yaml(fields)


def opencv(fields, size):
    matrices = {key: (rows, cols, list(map(repr, data))) for key, (rows, cols, data) in fields.items()}
    return as_yaml({"image_width": size[0], "image_height": size[1]} | matrices)


def matlab(R, T, cameras, size, unit="millimeters"):
    """Variables of toStruct(stereoParams); ``cameras``: (K, radial, tangential) in OpenCV's conventions."""
    content = {"RotationOfCamera2": np.transpose(R), "TranslationOfCamera2": np.reshape(T, (1, 3))}
    for number, (K, radial, tangential) in enumerate(cameras, start=1):
        one_based = np.array(K, dtype=float)
        one_based[:2, 2] += 1
        content[f"CameraParameters{number}"] = {
            "IntrinsicMatrix": one_based.T, "RadialDistortion": np.reshape(radial, (1, -1)),
            "TangentialDistortion": np.reshape(tangential, (1, 2)), "ImageSize": [[size[1], size[0]]],
            "WorldUnits": unit, "EstimateSkew": True, "WorldPoints": np.zeros((54, 2)),
            "Version": {"Name": "Computer Vision Toolbox", "Version": "10.4"},
        }  # fmt: skip
    return content


def bouguet_camera(side):
    (fx, fy), (cx, cy), k = (BOUGUET[f"{name}_{side}"] for name in ("fc", "cc", "kc"))
    return [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], [k[0], k[1], k[4]], k[2:4]


def _asl(name, model=None):
    rig = ASL[name]
    return [euroc(rig["size"], camera["T_BS"], camera["intrinsics"], camera["D"], rig["lens"])
            for camera in rig["cameras"]]  # fmt: skip


def _ros(name):
    rig = ROS[name]
    return {f"{side}.yaml": ros(rig["size"], *rig[side].values(), name=f"narrow_stereo/{side}") for side in rig
            if side != "size"}  # fmt: skip


def _mynt(model):
    return {f"img.params.{model}": mynt((MYNT["size"], model, *MYNT[model]))}


ZED_TOOL = (
    [([[369.2, 0, 484.1], [0, 368.9, 296.3], [0, 0, 1]], [0.31, 0.052, 1.9e-4, -8.1e-5, 0.0021, 0.341, 0.092, 0.0089]),
     ([[369.7, 0, 477.6], [0, 369.4, 303.8], [0, 0, 1]], [0.33, 0.049, -1.2e-4, 2.3e-4, 0.0019, 0.362, 0.09, 0.0081])],
    [0.0031, -0.0052, 0.0017], [-119.87, 1.42, -2.31],
)  # fmt: skip

# From the right camera to the left one.
TUM_VI_C1_C2 = np.array(TUM_VI["cameras"][0]["T_cam_imu"]) @ np.linalg.inv(TUM_VI["cameras"][1]["T_cam_imu"])

_euroc = ASL["euroc"]
_imu_cam = [{"T_imu_cam": camera["T_BS"], "intrinsics": camera["intrinsics"], "D": camera["D"]}
            for camera in _euroc["cameras"]]  # fmt: skip

RIGS = {
    "bouguet": Files({"stereo.mat": BOUGUET}, ("bouguet/Calib_Results_stereo.mat",)),
    "concave_640": Files(_ros("concave_640"), ("concave_640/left.yaml", "concave_640/right.yaml")),
    "ps4eye": Files(_ros("ps4eye"), ("ps4eye/left.yaml", "ps4eye/right.yaml")),
    "euroc": Files(dict(zip(("cam0/sensor.yaml", "cam1/sensor.yaml"), _asl("euroc"))),
                   ("euroc/cam0_sensor.yaml", "euroc/cam1_sensor.yaml")),
    "euroc_kalibr": Files({"chain.yaml": kalibr(_euroc["size"], _imu_cam, header="%YAML:1.0\n")},
                          ("euroc/openvins_kalibr_imucam_chain.yaml",)),
    "euroc_orbslam": Files({"EuRoC.yaml": orbslam()}, ("euroc/orbslam2_EuRoC.yaml",)),
    "kitti": Files({"calib_cam_to_cam.txt": kitti()}, ("kitti_2011_09_26/calib_cam_to_cam.txt",)),
    "mrpt": Files({"mrpt.yml": opencv(MRPT, (1024, 768))}, ("mrpt_stereo/mrpt_bumblebee.yml",)),
    "mynteye_s1030_equidistant": Files(_mynt("equidistant"), ("mynteye_s1030/img.params.equidistant",)),
    "mynteye_s1030_pinhole": Files(_mynt("pinhole"), ("mynteye_s1030/img.params.pinhole",)),
    "mynteye_s_jpl": Files(dict(zip(("left.yaml", "right.yaml"), _asl("mynteye_s_jpl"))),
                           ("mynteye_s_jpl/left_sensor_fisheye.yaml", "mynteye_s_jpl/right_sensor_fisheye.yaml")),
    "oakd": Files({"depthai_calib.json": depthai()}, ("oakd_bw1098obc/depthai_calib.json",)),
    "realsense_d455": Files(dict(zip(("left.yaml", "right.yaml"), _asl("realsense_d455"))),
                            ("realsense_d455/LeftCameraParams.yaml", "realsense_d455/RightCameraParams.yaml")),
    "tum_vi": Files({"chain.yaml": kalibr(TUM_VI["size"], TUM_VI["cameras"], TUM_VI["lens"],
                                          header="%YAML:1.0 # need to specify the file type at the top!\n")},
                    ("tum_vi/kalibr_imucam_chain.yaml",)),
    "tum_vi_orbslam3": Files({"TUM-VI.yaml": orbslam3(TUM_VI["size"], TUM_VI["cameras"], TUM_VI_C1_C2)}),
    "unlook_1280": Files({"unlook_1280.yaml": opencv(UNLOOK_1280, (1280, 720))},
                         ("unlook_1280/calib-matlab-complete-export.yaml",)),
    "unlook_1456": Files({"unlook_1456.yaml": opencv(UNLOOK_1456, (1456, 1088))},
                         ("unlook_1456/calib_boofcv_test3.yaml",)),
    **{name: Files({"chain.yaml": kalibr(*(rig[key] for key in ("size", "cameras", "lens", "model")))})
       for name, rig in WIDE.items()},
    "zed": Files({"SN1010.conf": zed()}, ("zed_sn1010/zed-cam-sn-1010.conf",)),
    "zed_tool": Files({"zed_calibration_1010.yml": zed_tool((960, 600), *ZED_TOOL)}),
    "zed_vga": Files({"SN1010.conf": zed()}, ("zed_sn1010/zed-cam-sn-1010.conf",), {"size": (672, 376)}),
}  # fmt: skip
