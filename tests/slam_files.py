"""Calibration files of visual SLAM and odometry programs, in their words.

``cameras``: dicts with intrinsics (fx, fy, cx, cy), D, in OpenCV's order, and T_BS, 16 numbers or 4 rows.
"""

import json

import numpy as np
from rig_numbers import ASL, TUM_VI
from scipy.spatial.transform import Rotation

EUROC = ASL["euroc"]["cameras"]
FISHEYE = [camera | {"T_BS": np.linalg.inv(camera["T_cam_imu"])} for camera in TUM_VI["cameras"]]


def matrix(rows, cols, values, tag="!!opencv-matrix"):
    """As cv::FileStorage writes it, below a key."""
    data = ", ".join(map(repr, map(float, np.ravel(values))))
    return f"{tag}\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: [ {data} ]"


def basalt(size, cameras, kind="pinhole-radtan8", whole=True):
    names = {"kb4": ("k1", "k2", "k3", "k4"), "ds": ("xi", "alpha"), "eucm": ("alpha", "beta"), "ucm": ("alpha",)}
    names |= {"pinhole": (), "pinhole-radtan8": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")}
    content = {"T_imu_cam": [], "intrinsics": [], "resolution": [list(size)] * len(cameras), "vignette": []}
    for camera in cameras:
        pose, D = np.reshape(camera["T_BS"], (4, 4)), [*camera["D"], *[0.0] * 8]
        quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat()
        content["T_imu_cam"].append(dict(zip(("px", "py", "pz", "qx", "qy", "qz", "qw"), [*pose[:3, 3], *quaternion])))
        values = dict(zip(("fx", "fy", "cx", "cy"), camera["intrinsics"])) | dict(zip(names.get(kind, ()), D))
        content["intrinsics"].append({"camera_type": kind, "intrinsics": values})
    return json.dumps({"value0": content} if whole else content, indent=4)


def camodocal(size, camera, kind="PINHOLE", name="camera"):
    fx, fy, cx, cy = camera["intrinsics"]
    D = camera["D"]
    groups = {
        "PINHOLE": {"distortion_parameters": dict(zip(("k1", "k2", "p1", "p2"), D)),
                    "projection_parameters": {"fx": fx, "fy": fy, "cx": cx, "cy": cy}},
        "KANNALA_BRANDT": {"projection_parameters": dict(zip(("k2", "k3", "k4", "k5"), D))
                           | {"mu": fx, "mv": fy, "u0": cx, "v0": cy}},
        "MEI": {"mirror_parameters": {"xi": D[0]}, "distortion_parameters": dict(zip(("k1", "k2", "p1", "p2"), D[1:])),
                "projection_parameters": {"gamma1": fx, "gamma2": fy, "u0": cx, "v0": cy}},
        "SCARAMUZZA": {"poly_parameters": {"p0": -206.517, "p1": 0.0},
                       "inv_poly_parameters": {f"p{order}": value for order, value in enumerate(D[3:])},
                       "affine_parameters": dict(zip(("ac", "ad", "ae"), D)) | {"cx": cx, "cy": cy}},
    }.get(kind, {})  # fmt: skip
    lines = ["%YAML:1.0", "---", f"model_type: {kind}", f"camera_name: {name}"]
    lines += [f"image_width: {size[0]}", f"image_height: {size[1]}"]
    for group, values in groups.items():
        lines += [f"{group}:", *(f"   {key}: {value!r}" for key, value in values.items())]
    return "\n".join(lines) + "\n"


def vins(size, cameras, names=("left.yaml", "right.yaml"), changes=()):
    entries = {"imu": 1, "num_of_cam": 2, "image0_topic": '"/cam0/image_raw"'}
    entries |= {f"cam{number}_calib": f'"{name}"' for number, name in enumerate(names)}
    entries |= {"image_width": size[0], "image_height": size[1]}
    entries |= {f"body_T_cam{number}": matrix(4, 4, camera["T_BS"]) for number, camera in enumerate(cameras)}
    return "%YAML:1.0\n\n" + _lines(entries | dict(changes))


def okvis(size, cameras, kind="radialtangential"):
    lines = ["%YAML:1.0", "cameras:"]
    for camera in cameras:
        fx, fy, cx, cy = camera["intrinsics"]
        lines += [
            f"     - {{T_SC:\n        {np.ravel(camera['T_BS']).tolist()},\n        image_dimension: {list(size)},",
            f"        distortion_coefficients: {camera['D']},\n        distortion_type: {kind},",
            f"        focal_length: {[fx, fy]},\n        principal_point: {[cx, cy]},",
            "        camera_type: gray, #gray, rgb\n        sigma_pixels: = 0.8, # optional",
            "        slam_use: okvis}\n",
        ]
    return "\n".join([*lines, "imu_parameters:", "    T_BS:", "        [1.0, 0.0]"]) + "\n"


def aslam(size, cameras, lens="radial-tangential", kind="pinhole", inverted=False):
    lines = ["label: a_stereo_camera", "id: 412eab8e", "cameras:"]
    for index, camera in enumerate(cameras):
        K, D = camera["intrinsics"], camera["D"]
        key, pose = "T_B_C", np.reshape(camera["T_BS"], (4, 4))
        if inverted:
            key, pose = "T_C_B", np.linalg.inv(pose)
        lines += [
            f"- camera:\n    label: cam{index}\n    line-delay-nanoseconds: 0",
            f"    image_height: {size[1]}\n    image_width: {size[0]}\n    type: {kind}",
            f"    intrinsics:\n      cols: 1\n      rows: {len(K)}\n      data: {K}",
            f"    distortion:\n      type: {lens}\n      parameters:\n        cols: 1\n        rows: {len(D)}",
            f"        data: {D}\n  {key}:\n    cols: 4\n    rows: 4\n    data: {np.ravel(pose).tolist()}",
        ]
    return "\n".join(lines) + "\n"


def ov2slam(size, cameras, kind="pinhole", changes=()):
    entries = {}
    for number, (side, camera) in enumerate(zip(("left", "right"), cameras)):
        entries |= {f"Camera.model_{side}": kind, f"Camera.{side}_nwidth": size[0], f"Camera.{side}_nheight": size[1]}
        names = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")
        entries |= {
            f"Camera.{name}{side[0]}": value for name, value in zip(names, [*camera["intrinsics"], *camera["D"]])
        }
        entries[f"body_T_cam{number}"] = matrix(4, 4, camera["T_BS"])
    return "%YAML 1.0\n---\n\n" + _lines(entries | dict(changes)) + "mono: 0\nstereo: 1\n"


def orbslam3_old(size, cameras, kind="KannalaBrandt8", rows=3, changes=()):
    """With Tlr of ``rows`` rows; "3 of 4" stands for three, of which four are there."""
    names = ("k1", "k2", "k3", "k4") if kind == "KannalaBrandt8" else ("k1", "k2", "p1", "p2", "k3")
    entries = {"Camera.type": f'"{kind}"'}
    for name, camera in zip(("Camera", "Camera2"), cameras):
        entries |= {f"{name}.{key}": value for key, value in zip(("fx", "fy", "cx", "cy"), camera["intrinsics"])}
        entries |= {f"{name}.{key}": value for key, value in zip(names, camera["D"])}
    left, right = (np.reshape(camera["T_BS"], (4, 4)) for camera in cameras)
    pose = np.linalg.inv(left) @ right
    entries["Tlr"] = matrix(3, 4, pose) if rows == "3 of 4" else matrix(rows, 4, pose[:rows])
    entries |= {"Camera.width": size[0], "Camera.height": size[1], "Camera.bf": 19.3079}
    return "%YAML:1.0\n\n" + _lines(entries | dict(changes))


def stella(size, rectified, cameras, nested=True, model=None):
    """``rectified``: fx, fy, cx, cy and focal_x_baseline; ``cameras``: dicts with K, D and R."""
    camera = dict(zip(("fx", "fy", "cx", "cy", "focal_x_baseline"), rectified))
    camera |= {"name": '"pair"', "setup": '"stereo"', "model": '"perspective"', "cols": size[0], "rows": size[1]}
    source = {f"{key}_{side}": list(np.ravel(entry[key]).tolist()) for side, entry in zip(("left", "right"), cameras)
              for key in "KDR"}  # fmt: skip
    source |= {"model": f'"{model}"'} if model else {}
    lines = []
    for section, entries in (("Camera", camera), ("StereoRectifier", source)):
        lines += [f"{section}:"] if nested else []
        lines += [f"{'  ' if nested else section + '.'}{key}: {value}" for key, value in entries.items()]
    return "\n".join([*lines, "Mapping:", "  redundant_obs_ratio_thr: 0.9"]) + "\n"


def _lines(entries):
    return "\n".join(f"{key}: {value}" for key, value in entries.items() if value is not None) + "\n"
