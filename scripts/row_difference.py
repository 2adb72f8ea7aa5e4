"""``python -m scripts.row_difference``: how far apart the rows of one point are in real image pairs, before and after.

As `sim.rows` measures it: points are found in the images as the cameras gave them and followed through the float64 map,
rounded to 1/32 px as an exact core would. What is measured has gone through the calibration file, its interpretation,
the lens and the map.
"""

import sys
from pathlib import Path

import cv2
import numpy as np
import rich_click as click

from hdl.calibration import SIDES, Rig
from hdl.cli import run, steps
from hdl.errors import InputError
from hdl.geometry.rectification import rectify
from scripts import reference_rigs
from scripts.tables import json_option, show, write_json
from sim.alignment import RowDifference, rectified_positions
from sim.remap import CV2_FRACTION_BITS
from sim.rows import Withheld, find

LIMIT = 0.3  # px, of the mean after rectification
HEADINGS = ("rig", "points", "pairs", "number", "before", "after: mean", "median", "95 %", "mean, signed")


@click.command()
@reference_rigs.data_option
@json_option
def row_difference(data, json_file):
    """Mean row difference of matched points in the real image pairs, before and after rectification with the lens.

    Exit status 1 if it is 0.3 px or more after rectification for one of the rigs.
    """
    reference_rigs.check(data)
    rows = []
    with steps() as progress:
        for name, pairs in reference_rigs.IMAGES.items():
            progress(name)
            images = [tuple(read(data / file) for file in pair) for pair in pairs]
            rows.append({"rig": name, **measure(reference_rigs.load(name, data), images)})
    write_json(json_file, rows)
    show("Rows between the two images of a point, px", HEADINGS, map(as_text, rows), texts=2)
    if any(row["after"]["mean"] >= LIMIT for row in rows):
        click.echo(f"a mean of {LIMIT} px or more after rectification", err=True)
        sys.exit(1)


def measure(rig: Rig, images: list[tuple[np.ndarray, np.ndarray]]) -> dict:
    """Row differences of the points found in ``images``, pairs of grey pictures (height, width) uint8.

    Raises InputError for images of another size than the rig's, and where no pair bears a figure.
    """
    views = rectify(rig, lens=True)
    scale = 1 << CV2_FRACTION_BITS
    maps = {side: [np.floor(w * scale + 0.5) / scale for w in view.map()] for side, view in views.items()}
    kinds, before, after, reason = [], [], [], None
    for pair in images:
        if any(image.shape != (rig.height, rig.width) for image in pair):
            shapes = ", ".join(f"{image.shape[1]}x{image.shape[0]}" for image in pair)
            raise InputError(rig.source, "images", shapes, f"not the {rig.width}x{rig.height} of the calibration")
        try:
            kind, left, right = find(dict(zip(SIDES, pair)), views)
        except Withheld as withheld:
            reason = str(withheld)
            continue
        shown = [rectified_positions(*maps[side], at)[:, 1] for side, at in zip(SIDES, (left, right))]
        kinds.append(kind)
        before.append(left[:, 1] - right[:, 1])
        after.append((shown[0] - shown[1])[~np.isnan(shown).any(axis=0)])
    if not kinds:
        raise InputError(rig.source, "images", len(images), reason)
    return {
        "points": ", ".join(dict.fromkeys(kinds)),
        "pairs": len(images),
        "pairs_measured": len(kinds),
        **{when: RowDifference.of(np.concatenate(of))._asdict() for when, of in (("before", before), ("after", after))},
    }


def read(path: Path) -> np.ndarray:
    """(height, width) uint8. Raises InputError for a file that is no image."""
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise InputError(path, None, None, "not an image that can be read")
    return image


def as_text(row):
    """The cells of one row of the table."""
    before, after = row["before"], row["after"]
    return (
        row["rig"],
        row["points"],
        f"{row['pairs_measured']} of {row['pairs']}",
        str(after["n"]),
        f"{before['mean']:.2f}",
        f"{after['mean']:.3f}",
        f"{after['median']:.3f}",
        f"{after['percentile_95']:.3f}",
        f"{after['signed_mean']:+.3f}",
    )


if __name__ == "__main__":
    run(row_difference)
