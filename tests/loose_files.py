"""OpenCV's matrices as people save them, and what RealSense prints.

``rig``: a dict of K1, D1, K2, D2, R and T, nested lists, and image_size.
"""

import numpy as np
from calibration_files import turn

RIG = {
    "image_size": [640, 480],
    "K1": [[500.25, 0, 320.5], [0, 501.75, 240.125], [0, 0, 1]], "D1": [[-0.25, 0.0625, 1e-3, -5e-4, 0.01]],
    "K2": [[498.5, 0, 316.75], [0, 497.25, 236.5], [0, 0, 1]], "D2": [[-0.26, 0.07, -1e-3, 2e-4, 0.01]],
    "R": turn(0.01, -0.02, 0.005).tolist(), "T": [[-0.1], [0.0015], [-0.0005]],
}  # fmt: skip
NAMES = {
    "numbered": {"K1": "K1", "D1": "D1", "K2": "K2", "D2": "D2", "R": "R", "T": "T"},
    "matrices": {"K1": "M1", "D1": "dist1", "K2": "M2", "D2": "dist2", "R": "R", "T": "T"},
    "arguments": {"K1": "cameraMatrix1", "D1": "distCoeffs1", "K2": "cameraMatrix2", "D2": "distCoeffs2",
                  "R": "R", "T": "T"},
    "tutorial": {"K1": "mtxL", "D1": "distL", "K2": "mtxR", "D2": "distR", "R": "Rot", "T": "Trns"},
    "sides": {"K1": "camera_matrix_left", "D1": "dist_coeff_left", "K2": "camera_matrix_right",
              "D2": "dist_coeff_right", "R": "Rotation", "T": "Translation"},
    "sides first": {"K1": "left_camera_matrix", "D1": "left_distortion", "K2": "right_camera_matrix",
                    "D2": "right_distortion", "R": "rotation_between_cameras", "T": "translation_between_cameras"},
    "letters": {"K1": "K_left", "D1": "D_left", "K2": "K_right", "D2": "D_right", "R": "rotation_matrix",
                "T": "translation-vector"},
    "words": {"K1": "Left Camera Matrix", "D1": "Left Dist Coeffs", "K2": "Right Camera Matrix",
              "D2": "Right Dist Coeffs", "R": "Rotation Matrix", "T": "Translation Vector"},
}  # fmt: skip


def is_the_rig(rig):
    assert (rig.width, rig.height, rig.unit) == (640, 480, None)
    assert rig.left.K.tolist() == RIG["K1"] and rig.right.K.tolist() == RIG["K2"]
    assert rig.left.D.tolist() == RIG["D1"][0] and rig.right.D.tolist() == RIG["D2"][0]
    assert rig.left.model == rig.right.model == "radtan"
    assert np.abs(rig.R - RIG["R"]).max() < 1e-15 and rig.T.tolist() == [-0.1, 0.0015, -0.0005]
    assert not rig.warnings and not rig.notes


def npz(content, name="rig.npz", save=np.savez):
    save(name, **{key: np.array(value) for key, value in content.items()})
    return name


def renamed(rig, names):
    return {names.get(key, key): value for key, value in rig.items()}


def nested(rig):
    """A camera an object, and the motion one."""
    cameras = {side: {"K": rig[f"K{n}"], "dist": rig[f"D{n}"]} for side, n in (("left", 1), ("right", 2))}
    return cameras | {"stereo": {"R": rig["R"], "T": rig["T"]}, "image_size": rig["image_size"]}


def realsense(blocks, extrinsics, other=""):
    """``blocks``: (stream, (width, height), formats, (fx, fy, cx, cy), distortion, coefficients) or, without numbers,
    (stream, (width, height), formats); ``extrinsics``: (from, to, R, T)."""
    lines = [
        "Device info: ",
        "    Name                          : \tIntel RealSense",
        "",
        "Intrinsic Parameters:",
        "",
        "",
    ]
    for stream, (width, height), formats, *numbers in blocks:
        lines.append(f' Intrinsic of "{stream}" / {width}x{height} / {{{formats}}}')
        if not numbers:
            lines += ["Intrinsic NOT available!", "", ""]
            continue
        (fx, fy, cx, cy), distortion, D = numbers
        entries = {"Width": width, "Height": height, "PPX": cx, "PPY": cy, "Fx": fx, "Fy": fy, "Distortion": distortion}
        lines += [f"  {key + ':':<10}\t{value}" for key, value in entries.items()]
        lines += ["  Coeffs:     " + "".join(f"\t{value}  " for value in D), "  FOV (deg):  \t79.58 x 63.98", "", ""]
    lines += ["Motion Intrinsic Parameters:", "", 'Motion Intrinsic of "Gyro"\t  MOTION_XYZ32F']
    lines += ["Intrinsic NOT available!", "", "", "", "Extrinsic Parameters:"]
    for first, second, R, T in extrinsics:
        lines += [f'Extrinsic from "{first}"\t  To\t  "{second}" :', " Rotation Matrix:"]
        lines += ["".join(f"{value:<17.6g}" for value in row) for row in np.asarray(R).tolist()]
        lines += ["", " Translation Vector: " + "".join(f"{value}  " for value in T), "", ""]
    return "\n".join([*lines, other]) + "\n"
