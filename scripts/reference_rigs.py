"""The calibrations of real rigs, and images of theirs, that lie beside the project in ``../shared/data/rigs``."""

from pathlib import Path

import rich_click as click

from hdl import calibration
from hdl.calibration import Rig
from hdl.errors import InputError

FOLDER = Path(__file__).resolve().parents[2] / "shared" / "data" / "rigs"
data_option = click.option(
    "--data", type=click.Path(path_type=Path), default=FOLDER, help="The folder of the reference rigs."
)

# Name to the files that describe one rig.
CALIBRATIONS = {
    "Bouguet's example": ["bouguet/Calib_Results_stereo.mat"],
    "Concave": ["concave_640/left.yaml", "concave_640/right.yaml"],
    "EuRoC": ["euroc/cam0_sensor.yaml", "euroc/cam1_sensor.yaml"],
    "EuRoC, Kalibr": ["euroc/openvins_kalibr_imucam_chain.yaml"],
    "EuRoC, ORB-SLAM": ["euroc/orbslam2_EuRoC.yaml"],
    "KITTI": ["kitti_2011_09_26/calib_cam_to_cam.txt"],
    "MRPT": ["mrpt_stereo/mrpt_bumblebee.yml"],
    "MYNT S1030, pinhole": ["mynteye_s1030/img.params.pinhole"],
    "MYNT S1030, fisheye": ["mynteye_s1030/img.params.equidistant"],
    "MYNT S JPL": ["mynteye_s_jpl/left_sensor_fisheye.yaml", "mynteye_s_jpl/right_sensor_fisheye.yaml"],
    "OAK-D": ["oakd_bw1098obc/depthai_calib.json"],
    "OpenCV samples": ["opencv_samples/calibrated/opencv_left_right.yml"],
    "PS4 Eye": ["ps4eye/left.yaml", "ps4eye/right.yaml"],
    "RealSense D455": ["realsense_d455/LeftCameraParams.yaml", "realsense_d455/RightCameraParams.yaml"],
    "TUM-VI": ["tum_vi/kalibr_imucam_chain.yaml"],
    "Unlook 1280": ["unlook_1280/calib-matlab-complete-export.yaml"],
    "Unlook 1456": ["unlook_1456/calib_boofcv_test3.yaml"],
    "ZED": ["zed_sn1010/zed-cam-sn-1010.conf"],
}


# Image pairs of a rig: (left, right) files.
IMAGES = {
    "OpenCV samples": [
        (f"opencv_samples/left{i:02}.jpg", f"opencv_samples/right{i:02}.jpg") for i in range(1, 15) if i != 10
    ],
    "MRPT": [(f"mrpt_stereo/{i}_left.jpg", f"mrpt_stereo/{i}_right.jpg") for i in range(4)],
    "MYNT S JPL": [("mynteye_s_jpl/left_fisheye_img_0.png", "mynteye_s_jpl/right_fisheye_img_0.png")],
    "EuRoC": [("euroc/left_img_0.png", "euroc/right_img_0.png")],
}


def load(name: str, folder: Path = FOLDER, size=None) -> Rig:
    """The rig called ``name``. Raises InputError where ``folder`` does not hold it."""
    return calibration.load(*(folder / file for file in CALIBRATIONS[name]), size=size)


def check(folder: Path) -> None:
    """Raise InputError unless ``folder`` is there."""
    if not folder.is_dir():
        raise InputError("--data", None, folder, "no folder of reference rigs; the project does not contain it")
