"""Which format a file is taken for, what a folder stands for, and lenses that no format can bring."""

import sys
from pathlib import Path

import numpy as np
import pytest
from calibration_files import RIG, as_yaml, refusal, write
from format_files import RIGS, bouguet_camera, matlab
from forms import FORMS
from scipy.io import savemat

from hdl.calibration import FORMATS, load
from hdl.calibration.documents import Document

NAMES = [format.NAME for format in FORMATS]


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def mat(variables, name="rig.mat", **options):
    savemat(name, variables, **options)
    return name


@pytest.mark.parametrize("name", RIGS)
def test_each_file_is_recognised_by_its_content_alone(name):
    expected = load(*RIGS[name].write("own"), **RIGS[name].options)
    for index, path in enumerate(RIGS[name].write("renamed")):
        path.rename(f"{index}")
    paths = [str(index) for index in range(len(RIGS[name].contents))]
    assert load(*paths, **RIGS[name].options).format == expected.format
    assert load(*paths, format=expected.format, **RIGS[name].options).format == expected.format


@pytest.mark.parametrize("name", RIGS)
def test_only_formats_of_plain_matrices_recognise_what_another_does(name):
    for path in RIGS[name].write():
        document = Document.open(path)
        recognising = [format.NAME for format in FORMATS if format.recognises(document)]
        assert len(set(recognising) - {"opencv", "plain"}) == (name not in ("mrpt", "unlook_1280", "unlook_1456"))


@pytest.mark.parametrize("name", FORMS)
def test_each_form_is_recognised_by_its_content_alone(name):
    """Whatever the files are called; only VINS finds its cameras by their names."""
    for path in FORMS[name].write():
        document = Document.open(path)
        recognising = [format.NAME for format in FORMATS if format.recognises(document)]
        assert recognising[0] == name.split(" ")[0]
        assert set(recognising) <= {recognising[0], "opencv", "plain"}


def test_format_can_be_forced():
    fields = {name: value for name, value in RIG.items() if name not in ("M1", "M2")}
    both = as_yaml(fields | {"camera_matrix_left": RIG["M1"], "camera_matrix_right": RIG["M2"], "LEFT.K": RIG["M1"]})
    assert refusal(write(both)) == "rig.yml: LEFT.width: missing"
    assert load("rig.yml", format="opencv").left.K[0, 0] == 500.25
    known = ", ".join(NAMES)
    assert refusal("rig.yml", format="yaml") == f"--format: yaml: the formats are {known}"


@pytest.mark.parametrize("name", ["ros", "euroc", "bouguet", "matlab", "orbslam", "opencv"])
def test_choice_is_refused_where_there_is_none(name):
    rigs = {"ros": "ps4eye", "euroc": "euroc", "bouguet": "bouguet", "orbslam": "euroc_orbslam", "opencv": "mrpt"}
    if name == "matlab":
        paths = [mat({"s": matlab(np.eye(3), [-60, 0, 0], [bouguet_camera("left")] * 2, (640, 480))})]
    else:
        paths = RIGS[rigs[name]].write()
    assert ": there is nothing to choose in a calibration of " in refusal(*paths, select="1,2")


class TestFolders:
    @pytest.mark.parametrize("name", ["ps4eye", "mynteye_s_jpl", "kitti", "zed", "oakd", "bouguet", "unlook_1280"])
    def test_folder_stands_for_the_calibration_in_it(self, name):
        paths = RIGS[name].write("folder")
        write("read me", "folder/SOURCE.txt")
        write(b"\x89PNG\r\n\x1a\n\x00", "folder/left.png")
        write(b"\x89PNG" + bytes(2 << 20), "folder/large.png")
        write("{broken: [", "folder/.hidden")
        assert np.array_equal(load("folder").R, load(*paths).R)

    def test_folder_of_an_asl_dataset_has_its_cameras_in_folders(self):
        RIGS["euroc"].write("mav0")
        write_in("mav0/imu0/sensor.yaml", "T_BS:\n  data: []\nrate_hz: 200\n")
        assert load("mav0").source == "mav0/cam0/sensor.yaml, mav0/cam1/sensor.yaml"

    def test_folder_of_several_formats_asks_for_one(self):
        for name in ("mynteye_s_jpl", "euroc_kalibr"):
            RIGS[name].write("folder")
        assert refusal("folder") == (
            "kalibr: folder/chain.yaml; euroc: folder/left.yaml, folder/right.yaml: "
            "files of different calibration formats; name those of one, or choose it with --format"
        )
        assert load("folder", format="euroc").format == "euroc"
        assert load("folder", format="kalibr").format == "kalibr"

    def test_folder_of_several_complete_calibrations_asks_for_one(self):
        for name in ("mynteye_s1030_pinhole", "mynteye_s1030_equidistant"):
            RIGS[name].write("folder")
        assert refusal("folder") == (
            "folder/img.params.equidistant, folder/img.params.pinhole: "
            "several calibrations (MYNT EYE img.params (YAML)), each complete in itself; name one"
        )

    def test_folder_with_too_many_files_is_not_searched(self):
        for number in range(501):
            write_in(f"folder/{number}", "")
        assert refusal("folder") == "folder: more than 500 files in this folder; name the calibration"

    def test_links_out_of_a_folder_are_not_followed(self, tmp_path):
        RIGS["zed"].write("elsewhere")
        (tmp_path / "folder").mkdir()
        (tmp_path / "folder" / "rig.conf").symlink_to(tmp_path / "elsewhere" / "SN1010.conf")
        (tmp_path / "folder" / "loop").symlink_to(tmp_path / "folder" / "loop")
        assert refusal("folder") == "folder: no calibration file of a known format in this folder"

    def test_no_other_file_is_opened(self, tmp_path):
        opened = []
        RIGS["bouguet"].write("folder")
        RIGS["ps4eye"].write("pair")
        load("folder")  # imports what it needs
        sys.addaudithook(lambda event, args: opened.append(args[0]) if event == "open" and opened is not None else None)
        load("folder")
        load("pair/left.yaml", "pair/right.yaml")
        seen, opened = {str(name) for name in opened}, None
        assert seen == {"folder/stereo.mat", "pair/left.yaml", "pair/right.yaml"}


def write_in(path, content):
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    return write(content, path)
