"""``python -m scripts.figure5``: the paper's Figure 5 from the pixels of the exported Verilog.

Both cameras' images as they came, through the conventional core and through the proposed one, with horizontal lines;
then through the datapaths that are fitted and those that take the lens. The paper has no lens, so a scene is rendered
without one; with the lens in the picture, rendered or real, cores without it are shown for what they do to that.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import rich_click as click

from hdl import calibration
from hdl.calibration import SIDES, Rig
from hdl.cli import FolderType, run, steps
from hdl.datapaths import DATAPATHS
from hdl.errors import InputError
from hdl.geometry.rectification import rectify
from scripts import reference_rigs
from scripts.compiled_cores import Cores
from scripts.figure5_drawing import Row, draw
from scripts.row_difference import read
from scripts.tables import json_option, show, write_json
from sim.alignment import in_px, rectified_positions
from sim.frame import frame_through
from sim.rows import KNOWN_POINTS, Withheld, find
from sim.scene import render, visible_points

PAPERS = ("conventional", "proposed")
HEADINGS = ("picture", "row", "points", "rows differ by: mean", "max", "coordinates off by: mean", "max")
TEXTURED = 0.05  # share of the points, those with the most contrast around them, that a detail is chosen from
MARGIN = 30  # px between a detail's point and the edges


@dataclass(frozen=True)
class Pair:
    """Two images to rectify.

    Members
    -------
    name : str
        Of the file.
    title : str
    rig : Rig
    lens : bool
        Whether the images were taken through the lens.
    images : {side: (height, width) uint8}
    points : {side: (n, 2)}
        Source positions of points that both images show, px; followed through the cores' coordinates.
    points_by : str
        How they are known.
    """

    name: str
    title: str
    rig: Rig
    lens: bool
    images: dict[str, np.ndarray]
    points: dict[str, np.ndarray]
    points_by: str = "truth"


@click.command()
@click.option(
    "--rig",
    "names",
    type=click.Choice(list(reference_rigs.IMAGES)),
    multiple=True,
    metavar="NAME",
    help="Real pairs to show, besides the rendered ones; may be repeated: "
    f"{', '.join(reference_rigs.IMAGES)}. Default: {next(iter(reference_rigs.IMAGES))}, where there.",
)
@reference_rigs.data_option
@click.option(
    "--output",
    type=FolderType(),
    default=Path("build/figure5"),
    show_default=True,
    metavar="DIR",
    help="Where the pictures go.",
)
@json_option
def figure5(names, data, output, json_file):
    """Draw images before and after the cores, with epipolar lines, and how far rows and coordinates are off.

    Exit status 1 if a core's pixels are not those of its integer model.
    """
    if names:
        reference_rigs.check(data)
    elif data.is_dir():
        names = (next(iter(reference_rigs.IMAGES)),)
    output.mkdir(parents=True, exist_ok=True)
    results, broken, files = [], [], []
    with steps() as progress:
        cores = Cores(progress)
        for pair in pairs(names, data, progress):
            progress(f"{pair.title}: cores")
            rows = rows_of(pair, cores, broken)
            progress(f"{pair.title}: drawing")
            files.append(output / f"{pair.name}.png")
            draw(files[-1], pair.title, (pair.rig.width, pair.rig.height), rows, detail(pair, rows))
            results += [{"picture": pair.name, **row.measured} for row in rows]
    write_json(json_file, results)
    show("Rows between the two images of a point, and coordinates against the exact map, px", HEADINGS,
         map(as_text, results), 2)  # fmt: skip
    for line in [*dict.fromkeys(cores.refusals), *files]:
        click.echo(line)
    for line in broken:
        click.echo(line, err=True)
    if broken:
        sys.exit(1)


def pairs(names, data, progress):
    """The `Pair`s to show."""
    rig = calibration.embedded()
    frame = f"{rig.width}x{rig.height}"
    for lens in (False, True):
        progress("rendering a scene")
        points = visible_points(rig, lens, KNOWN_POINTS)[1]
        how = "with" if lens else "without"
        yield Pair(
            f"rendered_{how}_lens",
            f"A rendered scene {how} the lens's distortion, embedded rig, {frame}",
            rig,
            lens,
            render(rig, lens),
            points,
        )
    for name in names:
        rig, real = reference_rigs.load(name, data), reference_rigs.IMAGES[name]
        images = {side: read(data / file) for side, file in zip(SIDES, real[0])}
        points_by, points = found_points(images, rig)
        yield Pair(
            "".join(letter if letter.isalnum() else "_" for letter in name.lower()),
            f"{name}, a real pair, {rig.width}x{rig.height}",
            rig,
            True,
            images,
            points,
            points_by,
        )


def found_points(images, rig):
    """What points of real images are, and where both show them; raises InputError where they cannot be relied on."""
    try:
        kind, *found = find(images, rectify(rig, lens=True))
    except Withheld as reason:
        raise InputError(rig.source, "images", None, str(reason)) from None
    return kind, dict(zip(SIDES, found))


def rows_of(pair, cores, broken):
    """The `Row`s of the figure; what is wrong with the hardware is appended to ``broken``, a line each."""
    exact = rectify(pair.rig, lens=pair.lens)
    takes_lens = [name for name in DATAPATHS if DATAPATHS[name].supports_lens]
    rows = [row_of(pair, "original", pair.images, None, None)]
    for lens, names in ((False, PAPERS), (True, takes_lens)) if pair.lens else ((False, list(DATAPATHS)),):
        for group, made in cores.of(pair.rig, lens, names).items():
            label = ", ".join(group) + (f", {'with' if lens else 'without'} the lens" if pair.lens else "")
            images, maps, off = {}, {}, {}
            for side, (core, compiled) in made.items():
                result = frame_through(core, compiled, 0.0, pair.images[side])
                if result.model_differences:
                    broken.append(
                        f"{pair.name}: {label}, {side} camera: {result.model_differences} pixels are not the integer "
                        "model's"
                    )
                images[side] = result.rectified
                maps[side] = in_px(core.parameters.datapath.coordinates)
                off[side] = coordinate_error(maps[side], exact[side])
            rows.append(row_of(pair, label, images, maps, off, group, lens))
    return rows


def coordinate_error(used, view):
    """Distance of the coordinates ``used``, (u, v) in px, from the exact map of ``view``: px, (height, width), NaN
    where the exact source is outside the image."""
    (u, v), (exact_u, exact_v) = used, view.map()
    return np.where(view.inside, np.hypot(u - exact_u, v - exact_v), np.nan)


def row_of(pair, label, images, maps, off, group=(), lens=None):
    """One `Row`: ``maps`` and ``off``, {side: (u, v)} and {side: `coordinate_error`}, are None for the original."""
    followed = {
        side: pair.points[side] if maps is None else rectified_positions(*maps[side], pair.points[side])
        for side in SIDES
    }
    difference = np.abs(followed["left"][:, 1] - followed["right"][:, 1])
    difference = difference[~np.isnan(difference)]
    coordinates = off and np.concatenate([error[~np.isnan(error)] for error in off.values()])
    return Row(
        label,
        images,
        followed,
        off,
        {
            "row": label,
            "datapaths": list(group),
            "lens": lens,
            "points_by": pair.points_by,
            "points": difference.size,
            "row_difference": _statistics(difference),
            "coordinate_error": _statistics(coordinates) if off else None,
        },
    )


def _statistics(magnitude):
    return {"mean": float(magnitude.mean()), "max": float(magnitude.max())} if magnitude.size else None


def detail(pair, rows):
    """Which of the pair's points to show enlarged: of those with the most contrast around them that all rows show, the
    one that the paper's method leaves farthest apart. None if there is none."""
    last = np.array([pair.rig.width, pair.rig.height]) - 1 - MARGIN
    shown = np.logical_and.reduce(
        [((row.points[side] >= MARGIN) & (row.points[side] <= last)).all(axis=1) for row in rows for side in SIDES]
    )
    x, y = np.round(pair.points["left"]).astype(int).T
    contrast = np.where(shown, cv2.cornerMinEigenVal(pair.images["left"], 7)[y, x], -1.0)
    paper = next((row for row in rows if row.measured["datapaths"] == [PAPERS[1]]), rows[0])
    apart = np.abs(paper.points["left"][:, 1] - paper.points["right"][:, 1])
    # Among few points, as a chessboard's, all will do.
    enough = np.quantile(contrast, 1 - max(TEXTURED, min(1, 60 / contrast.size)))
    apart = np.where(shown & (contrast >= enough), apart, -1.0)
    return int(apart.argmax()) if apart.max() >= 0 else None


def as_text(row):
    """The cells of a row of the table."""
    cells = [
        (f"{of['mean']:.3f}", f"{of['max']:.3f}") if of else ("-", "-")
        for of in (row["row_difference"], row["coordinate_error"])
    ]
    return row["picture"], row["row"], f"{row['points']} ({row['points_by']})", *cells[0], *cells[1]


if __name__ == "__main__":
    run(figure5)
