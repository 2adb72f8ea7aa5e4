"""Which camera is which: what became left and right is said, by the entry and the file that it was read from."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from calibration_files import RIG, as_yaml, transform, write
from format_files import depthai, euroc, kalibr, kitti, matlab, orbslam, zed
from rig_numbers import ASL
from scipy.io import savemat

from hdl import cli
from hdl.calibration import embedded, load
from hdl.calibration.__main__ import describe
from hdl.core.plan_file import load_folder
from hdl.generate import generate

CHAIN = [{"intrinsics": [80.0, 80, 48, 32], "D": [0.0, 0, 0, 0]},
         {"intrinsics": [81.0, 81, 49, 31], "D": [0.0, 0, 0, 0], "T_cn_cnm1": transform(np.eye(3), [0.2, 0, 0])},
         ]  # fmt: skip
EUROC = ASL["euroc"]["cameras"]


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def chain():
    """A file whose cam1 stands on the left of cam0."""
    return write(kalibr((96, 64), CHAIN), "chain.yaml")


@pytest.fixture
def command(monkeypatch, capsys):
    def run(function, *arguments):
        monkeypatch.setattr(sys, "argv", ["command", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.run(function)
        captured = capsys.readouterr()
        assert ended.value.code == 0, captured.err
        return captured.out, captured.err

    return run


def asl(*names, cameras=EUROC):
    for name, camera in zip(names, cameras):
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        write(euroc(ASL["euroc"]["size"], *camera.values()), name)
    return names


class TestOrigins:
    @pytest.mark.parametrize("name, write_it, left, right", [
        ("chain.yaml", lambda path: write(kalibr((96, 64), CHAIN), path), "cam1", "cam0"),
        ("calib_cam_to_cam.txt", lambda path: write(kitti(), path), "camera 00", "camera 01"),
        ("depthai_calib.json", lambda path: write(depthai(), path), "socket 1", "socket 2"),
        ("EuRoC.yaml", lambda path: write(orbslam(), path), "LEFT", "RIGHT"),
        ("SN1010.conf", lambda path: write(zed(), path), "LEFT_CAM_2K", "RIGHT_CAM_2K"),
        ("rig.yml", lambda path: write(as_yaml(RIG), path), "M1", "M2"),
        ("rig.mat", lambda path: savemat(path, matlab(np.eye(3), [-60.0, 0, 0], [(np.diag([500, 500, 1])
                                         + [[0, 0, 320], [0, 0, 240], [0, 0, 0]], [0.1, 0], [0, 0])] * 2, (640, 480))),
         "CameraParameters1", "CameraParameters2"),
    ])  # fmt: skip
    def test_entries_of_one_file_have_their_names(self, name, write_it, left, right):
        Path("folder").mkdir()
        write_it(f"folder/{name}")
        assert load(f"folder/{name}").origins == {"left": f"{left} of {name}", "right": f"{right} of {name}"}

    def test_files_of_one_camera_each_are_enough(self):
        assert load(*asl("a.yaml", "b.yaml")).origins == {"left": "a.yaml", "right": "b.yaml"}

    def test_files_of_one_name_have_as_much_of_their_folders_as_tells_them_apart(self):
        paths = asl("data/cam0/mav/sensor.yaml", "data/cam1/mav/sensor.yaml")
        expected = {"left": "cam0/mav/sensor.yaml", "right": "cam1/mav/sensor.yaml"}
        assert load(*paths).origins == expected
        assert load(*(Path(path).resolve() for path in paths)).origins == expected

    def test_names_that_no_text_should_hold_are_made_printable(self, chain):
        name = f"a\nb\t{'x' * 90}ü.yaml"
        Path(chain).rename(name)
        left = load(name).origins["left"]
        assert left.startswith("cam1 of a?b?xxx") and left.isascii() and left.isprintable()
        assert len(left) == 100 and left.endswith("...")

    def test_embedded_rig_says_what_it_is(self):
        assert embedded().origins == {
            "left": "M1 of the embedded example rig", "right": "M2 of the embedded example rig"
        }  # fmt: skip


class TestSides:
    def test_numbered_cameras_are_called_by_where_they_stand_and_that_is_said(self, chain):
        rig = load(chain)
        assert rig.left.K[0, 0] == 81 and rig.T[0] == -0.2
        assert rig.notes == (
            "chain.yaml: as the cameras stand, the left one is cam1 of chain.yaml, the right one cam0 of chain.yaml",
        )
        assert load(*asl("b.yaml", "a.yaml")).notes == ()
        assert load("a.yaml", "b.yaml").notes == (
            "a.yaml, b.yaml: as the cameras stand, the left one is b.yaml, the right one a.yaml",
        )

    def test_chosen_cameras_stay_as_they_were_chosen(self, chain):
        rig = load(chain, select="0,1")
        assert rig.origins["left"] == "cam0 of chain.yaml" and not rig.notes
        assert "the camera called left is on the right" in rig.warnings[0]

    @pytest.mark.parametrize("order", [1, -1])
    def test_files_called_left_and_right_stay_so_and_are_warned_of(self, order):
        paths = asl("left.yaml", "right.yaml", cameras=EUROC[::-1])
        rig = load(*paths[::order])
        assert rig.origins == {"left": "left.yaml", "right": "right.yaml"}
        assert rig.left.K[0, 0] == EUROC[1]["intrinsics"][0] and not rig.notes
        assert rig.warnings[0].startswith("right.yaml: T_BS = [0.1")
        assert "the camera called left is on the right" in rig.warnings[0]


class TestWhereItIsSaid:
    def test_calibration_prints_it_in_its_table_and_in_json(self, chain, command):
        out, _ = command(describe, chain)
        lines = [" ".join(line.replace("│", " ").split()) for line in out.splitlines()]
        assert "read from cam1 of chain.yaml cam0 of chain.yaml" in lines
        assert "note: chain.yaml: as the cameras stand, the left one is cam1 of chain.yaml, the right one cam0" in out
        content = json.loads(command(describe, chain, "--json")[0])
        assert [content[side]["source"] for side in ("left", "right")] == ["cam1 of chain.yaml", "cam0 of chain.yaml"]

    def test_plan_and_verilog_have_it_without_the_folder(self, chain, command, tmp_path):
        options = ("--datapath", "proposed", "--output", "out")
        out, err = command(generate, tmp_path / chain, *options)
        assert "as the cameras stand, the left one is cam1 of chain.yaml" in err and "cam1 of chain.yaml" in out
        for side, entry in (("left", "cam1"), ("right", "cam0")):
            text = Path(f"out/rectify_{side}.v").read_text()
            assert text.splitlines()[1] == f"// Camera: {entry} of chain.yaml."
            assert str(tmp_path) not in text
            plan = json.loads(Path(f"out/rectify_{side}.json").read_text())
            assert plan["camera"]["source"] == f"{entry} of chain.yaml"
        before = Path("out/rectify_left.v").read_bytes()
        command(generate, chain, *options)
        assert Path("out/rectify_left.v").read_bytes() == before
        for core in load_folder("out").values():
            assert core.rebuild().verilog == core.verilog

    def test_example_rig_is_called_an_example(self, command):
        command(generate, "--camera", "left", "--datapath", "proposed", "--size", "64x48", "--output", "out")
        assert Path("out/rectify_left.v").read_text().splitlines()[1] == "// Camera: M1 of the embedded example rig."
