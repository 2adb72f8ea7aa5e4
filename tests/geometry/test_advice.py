"""What messages about calibrations and rectified views advise is tried: it does what the message says."""

import re
import shlex
from dataclasses import replace

import numpy as np
import pytest
from calibration_files import RECTIFICATION, RIG, as_yaml
from commands import ended
from standing_rigs import rotation, standing, write

from hdl import generate as generate_module
from hdl.calibration import Camera, load
from hdl.calibration.__main__ import describe
from hdl.generate import generate
from hdl.geometry.notes import warnings
from hdl.geometry.rectification import MAGNIFIED, RectificationOptions, helpful, magnification, rectify
from hdl.geometry.view import View


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def fisheye(rig, D=(-0.01, 0.02, -0.03, 0.01)):
    return replace(rig, **{side: Camera("equidistant", rig.camera(side).K, np.array(D)) for side in ("left", "right")})


def turned_by(degrees, rig=None, focal=115.0):
    """A file whose own rectification turns the images about the view, by quarters, so that rows or columns agree."""
    rig = rig or standing()
    views = rectify(rig, RectificationOptions(focal=focal, center=(79.5, 59.5)), lens=True)
    turn, given = rotation(0, 0, degrees), {}
    for side, view in views.items():
        K, place = view.P[:, :3], np.linalg.solve(view.P[:, :3], view.P[:, 3])
        given[side] = turn @ view.R, np.column_stack([K, K @ turn @ place])
    return write(rig, rectification=given)


def behind():
    """A file whose own rectification looks so far down that the frame reaches past 90 degrees."""
    rig = standing()
    views = rectify(rig, RectificationOptions(focal=60.0, center=(79.5, 59.5)), lens=True)
    return write(rig, rectification={side: (rotation(-70, 0, 0) @ view.R, view.P) for side, view in views.items()})


def ahead(*at):
    return write(standing(at=at))


def zooming():
    """Aslant, out of the image plane, and a lens that bends much: alpha 0 leaves little."""
    rig = standing(right=(3, -4, 2), at=(0.2, -0.12, 0.08))
    D = np.array([-0.4, 0.16, 0.0006, -0.0004, 0.03])
    return write(replace(rig, left=replace(rig.left, D=D), right=replace(rig.right, D=D)))


def faulty():
    fields = RIG | RECTIFICATION | {"P1": (3, 4, ["-450.", *RECTIFICATION["P1"][2][1:]])}
    with open("rig.yml", "w") as file:
        file.write(as_yaml(fields))
    return "rig.yml"


def sized(**fields):
    with open("rig.yml", "w") as file:
        file.write(as_yaml({name: value for name, value in (RIG | fields).items() if value is not None}))
    return "rig.yml"


ALPHA, FOV = "--alpha 0", "--fov 63"

# What makes the file, the options that are refused, the message's advice, and the options that follow it.
REFUSALS = [
    (faulty, "", "; --alpha 0 or --fov 65 would do", [ALPHA, "--fov 65"]),
    (behind, "", "behind the left camera; --alpha 0 or --fov 63 would do", [ALPHA, FOV]),
    (lambda: write(fisheye(standing())), "--alpha 0", "has none; choose --focal or --fov", ["--focal 130", "--fov 80"]),
    (lambda: write(standing()), "--alpha 0 --focal 130", "keep one of them", [ALPHA, "--focal 130"]),
    (lambda: write(standing()), "--focal 130 --fov 63", "keep one of them", ["--focal 130", FOV]),
    (lambda: write(standing()), "--max-fov-loss 0.1", "--minimise rows may", ["--max-fov-loss 0.1 --minimise rows"]),
    (lambda: ahead(0.1, 0, 0.09), "--center 0,0", "give one with --focal", ["--center 0,0 --focal 130"]),
    (lambda: ahead(0.1, 0, 0.09), FOV, "--center 0,62 is the nearest inside", [FOV + " --center 0,62"]),
    (lambda: ahead(0.1, 0, 0.09), "", "--focal 129 --center 0,60 would do", ["--focal 129 --center 0,60"]),
    (lambda: ahead(0.1, 0, 0.05), "--alpha 1", "--alpha 0 or --focal 129 --center 15,60 would do",
     [ALPHA, "--focal 129 --center 15,60"]),
    (lambda: sized(image_width=None, image_height=None), "", "give it with --size", ["--size 640x480"]),
]  # fmt: skip


@pytest.mark.parametrize("make, refused, advice, followed", REFUSALS, ids=[advice for _, _, advice, _ in REFUSALS])
def test_advice_of_a_refusal_works(make, refused, advice, followed, capsys):
    file = make()
    status, out, err = ended(capsys, describe, file, *shlex.split(refused))
    assert (status, out) == (2, "") and err.count("\n") == 1 and advice in err
    for options in followed:
        status, _, err = ended(capsys, describe, file, *shlex.split(options))
        assert (status, err) == (0, "")


@pytest.mark.parametrize("make, said", [
    (zooming, "magnifies about"),
    (lambda: turned_by(180), "turns the images by 180 degrees"),
    (lambda: turned_by(90, standing(at=(0.001, 0.1, 0))), "turns the images by 90 degrees"),
    (lambda: turned_by(180, fisheye(standing())), "turns the images by 180 degrees"),
    (lambda: ahead(0.1, 0.05, 0.09), "magnifies about"),
])  # fmt: skip
def test_advice_of_a_warning_silences_it(make, said, capsys):
    file = make()
    out = ended(capsys, describe, file)[1]
    (line,) = [line for line in out.splitlines() if said in line]
    options = re.findall(r"--(?:alpha|fov|focal) [0-9.]+(?: --center [0-9.,]+)?", line)
    assert options
    for option in options:
        status, out, _ = ended(capsys, describe, file, *option.split())
        assert status == 0 and said not in out and "only" not in out


def test_what_is_advised_shows_about_the_scale_of_the_images():
    rig = load(zooming())
    assert magnification(rig, rectify(rig, lens=True)["left"]) > 3
    assert (found := helpful(rig))
    for choice in found:
        views = rectify(rig, choice, lens=True)
        assert 1 / MAGNIFIED < magnification(rig, views["left"]) < MAGNIFIED
        assert all(view.inside.mean() > 0.5 for view in views.values())


@pytest.mark.parametrize("focal, warned", [(1.9, False), (2.1, True)])
def test_a_rectification_in_the_file_is_warned_of_from_twice_the_scale_on(focal, warned):
    rig = standing()
    f = focal * (0.8 + 0.81) / 2 * 160
    views = rectify(rig, RectificationOptions(focal=f), lens=True)
    loaded = load(write(rig, rectification={side: (view.R, view.P) for side, view in views.items()}))
    said = [line for line in warnings(loaded, rectify(loaded, lens=True)) if "magnifies" in line]
    assert said == (
        ["rig.yml: the rectification in the file magnifies about 2.1 times; --alpha 0 or --fov 63 shows more"] * warned
    )
    options = RectificationOptions(focal=f)  # which is what the user wants
    assert warnings(loaded, views, options) == []


def test_generate_refuses_what_no_core_can_follow_before_it_computes_one(capsys, monkeypatch):
    file = turned_by(180)
    with monkeypatch.context() as patch:
        patch.setattr(generate_module, "build", None)
        status, out, err = ended(capsys, generate, file)
    problem = (
        "the rectification in the file turns the images by 180 degrees, which costs two frames of memory; "
        "--alpha 0 or --fov 63 do without\n"
    )
    assert (status, out) == (2, "") and err.count("\n") == 1 and err.endswith(problem)
    status, _, err = ended(capsys, generate, file, "--alpha", "0", "--datapath", "proposed")
    assert (status, err.count("note: ")) == (0, 1) and "not used as it stands, because of --alpha" in err


def test_generate_names_the_row_that_no_core_waits_for(capsys):
    """A view shifted far down, not turned."""
    rig = standing()
    given = {
        side: (view.R, view.P - [[0, 0, 0, 0], [0, 0, 119, 0], [0, 0, 0, 0]])
        for side, view in rectify(rig, lens=True).items()
    }
    file = write(rig, rectification=given)
    status, _, err = ended(capsys, generate, file)
    assert status == 2
    assert re.search(
        r"R1 = .*: the first row of the rectified left image shows row 119 of the source's 120, and no core holds a "
        r"whole frame; --alpha 0 or --fov 63 would do\n", err
    )  # fmt: skip
    assert ended(capsys, generate, file, "--fov", "63", "--datapath", "proposed")[0] == 0


def test_minimising_leaves_turned_images_alone(capsys):
    """No small change helps, and the search would take half a minute at full size."""
    rig = load(turned_by(180))
    before, after = (rectify(rig, RectificationOptions(minimise=what), lens=True) for what in (None, "rows"))
    assert all(np.array_equal(before[side].P, after[side].P) for side in before)
    assert isinstance(after["left"].before, View)


def test_warnings_of_the_files_rectification_end_with_its_use(capsys):
    """KITTI's, say: an option that chooses another one makes them pointless."""
    rig = load(write(standing()))
    rig = rig.warned_as(ValueError("of the file's"), of="rectification")
    given = replace(rig, rectification={side: (v.R, v.P) for side, v in rectify(rig, lens=True).items()})
    for options, said in (({}, True), ({"minimise": "rows"}, True), ({"alpha": 0.0}, False), ({"focal": 130.0}, False)):
        options = RectificationOptions(**options)
        assert ("of the file's" in warnings(given, rectify(given, options, lens=True), options)) == said
