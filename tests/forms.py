"""One rig in every form that visual SLAM, ROS' terminal, RealSense and people's own programs write: name to files.

The name begins with the format's.
"""

import json

import numpy as np
import yaml
from format_files import Files
from loose_files import realsense
from rig_numbers import ASL, OCAM, ORBSLAM, ROS
from ros_files import message, ost
from slam_files import EUROC, FISHEYE, aslam, basalt, camodocal, okvis, orbslam3_old, ov2slam, stella, vins

_SIZE = ASL["euroc"]["size"]
_PS4EYE = [ROS["ps4eye"][side] for side in ("left", "right")]
_RECTIFIED = [ORBSLAM["LEFT.P"][2][index] for index in (0, 5, 2, 6)] + [-ORBSLAM["RIGHT.P"][2][3]]
_MATRICES = [{key: ORBSLAM[f"{side}.{key}"][2] for key in "KDR"} for side in ("LEFT", "RIGHT")]
_MOTION = np.linalg.inv(np.reshape(EUROC[1]["T_BS"], (4, 4))) @ np.reshape(EUROC[0]["T_BS"], (4, 4))
_PLAIN = {"image_size": _SIZE, "R": _MOTION[:3, :3].tolist(), "T": _MOTION[:3, 3].tolist()} | {
    f"{role}{number}": value
    for number, camera in enumerate(EUROC, start=1)
    for fx, fy, cx, cy in [camera["intrinsics"]]
    for role, value in (("K", [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), ("D", [*camera["D"], 0]))
}
_STREAMS = [(f"Infrared {number}", _SIZE, "Y8", camera["intrinsics"], "Brown Conrady", [*camera["D"], 0])
            for number, camera in enumerate(EUROC, start=1)]  # fmt: skip

FORMS = {
    "basalt": Files({"calibration.json": basalt(_SIZE, EUROC)}),
    "basalt kb4": Files({"calibration.json": basalt([512, 512], FISHEYE, "kb4")}),
    "okvis": Files({"okvis.yaml": okvis(_SIZE, EUROC)}),
    "aslam": Files({"cameras.yaml": aslam(_SIZE, EUROC)}),
    "ov2slam": Files({"ov2slam.yaml": ov2slam(_SIZE, EUROC)}),
    "orbslam3 old": Files({"TUM-VI.yaml": orbslam3_old([512, 512], FISHEYE)}),
    "stella": Files({"stella.yaml": stella(_SIZE, _RECTIFIED, _MATRICES)}),
    "stella flat": Files({"stella.yaml": stella(_SIZE, _RECTIFIED, _MATRICES, nested=False)}),
    "vins": Files({"vins.yaml": vins(_SIZE, EUROC)}
                  | {f"{side}.yaml": camodocal(_SIZE, camera) for side, camera in zip(("left", "right"), EUROC)}),
    "vins scaramuzza": Files({"vins.yaml": vins(OCAM["size"], EUROC)} | {
        f"{side}.yaml": camodocal(OCAM["size"], {"intrinsics": [0, 0, *OCAM["centre"]],
                                                 "D": [*OCAM["affine"], *OCAM["inverse"]]}, "SCARAMUZZA")
        for side in ("left", "right")}),
    "realsense": Files({"realsense.txt": realsense(_STREAMS, [("Infrared 1", "Infrared 2", _MOTION[:3, :3],
                                                               _MOTION[:3, 3])])}),
    "ros-message": Files({"info.txt": "".join(message(ROS["ps4eye"]["size"], **numbers) for numbers in _PS4EYE)}),
    "ros-message old": Files({f"{index}.txt": message(ROS["ps4eye"]["size"], **numbers, old=True)
                              for index, numbers in enumerate(_PS4EYE)}),
    "ost": Files({"ost.txt": "".join(ost(ROS["ps4eye"]["size"], **numbers) for numbers in _PS4EYE)}),
    "plain": Files({"stereo.json": json.dumps(_PLAIN)}),
    "plain yaml": Files({"stereo.yaml": yaml.safe_dump(_PLAIN)}),
}  # fmt: skip
