"""``python -m scripts.row_difference``: how far apart the rows of one point are in real image pairs, before and after.

Points are looked for twice, in the images as the cameras gave them and in the rectified ones, which are remapped with
the float64 map rounded to 1/32 px, as an exact core would: what is measured has gone through the calibration file, its
interpretation, the lens, the map and the interpolation.
"""

import sys
from pathlib import Path

import cv2
import numpy as np
import rich_click as click

from hdl.calibration import SIDES, Rig
from hdl.cli import run, steps
from hdl.errors import InputError
from hdl.geometry.rectification import RectificationOptions, View, rectify
from scripts import reference_rigs
from scripts.tables import json_option, show, write_json
from sim.matching import features
from sim.remap import CV2_FRACTION_BITS, cv2_remap

LIMIT = 0.3  # px, of the mean after rectification
HEADINGS = ("rig", "points by", "pairs", "points", "before", "after: mean", "median", "95 %", "mean, signed")


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
            images = [tuple(read(data / file) for file in pair) for pair in pairs.images]
            rows.append({"rig": name, **measure(reference_rigs.load(name, data), images, pairs.board)})
    write_json(json_file, rows)
    show("Rows between the two images of a point, px", HEADINGS, map(as_text, rows), texts=2)
    if any(row["after"]["mean"] >= LIMIT for row in rows):
        click.echo(f"a mean of {LIMIT} px or more after rectification", err=True)
        sys.exit(1)


def measure(rig: Rig, images: list[tuple[np.ndarray, np.ndarray]], board: tuple[int, int] | None) -> dict:
    """Row differences of the points found in ``images``, pairs of grey pictures (height, width) uint8.

    ``board``: inner corners of the chessboard to look for; None: SIFT features instead. Where the rectified frame cuts
    the board, the pair is rectified with alpha 1, which shows all of the image.

    Raises InputError for images of another size than the rig's, and where no point is found.
    """
    choices = [RectificationOptions(), RectificationOptions(alpha=1.0)] if board else [RectificationOptions()]
    rectifications = [rectify(rig, options, lens=True) for options in choices]
    found = {"before": [], "after": []}
    for pair in images:
        if any(image.shape != (rig.height, rig.width) for image in pair):
            shapes = ", ".join(f"{image.shape[1]}x{image.shape[0]}" for image in pair)
            raise InputError(rig.source, "images", shapes, f"not the {rig.width}x{rig.height} of the calibration")
        shown = ([rectified(views[side], image) for side, image in zip(SIDES, pair)] for views in rectifications)
        for when, attempts in (("before", [pair]), ("after", shown)):
            points = (corners(*attempt, board) if board else features(*attempt) for attempt in attempts)
            left, right = next((both for both in points if both is not None), (None, None))
            if left is not None:
                found[when].append(left[:, 1] - right[:, 1])
    if not all(found.values()):
        raise InputError(rig.source, "images", len(images), "no point is seen in both images of a pair")
    return {
        "method": "chessboard" if board else "SIFT",
        "pairs": len(images),
        **{when: statistics(differences) for when, differences in found.items()},
    }


def statistics(differences: list[np.ndarray]) -> dict:
    """Of the magnitudes of all differences together, px."""
    together = np.concatenate(differences)
    magnitude = np.abs(together)
    return {
        "pairs": len(differences),
        "points": together.size,
        "mean": float(magnitude.mean()),
        "median": float(np.median(magnitude)),
        "percentile_95": float(np.percentile(magnitude, 95)),
        "signed_mean": float(together.mean()),
    }


def rectified(view: View, image: np.ndarray) -> np.ndarray:
    """What an exact core makes of ``image``."""
    scale = 1 << CV2_FRACTION_BITS
    u, v = (np.floor(w * scale + 0.5).astype(np.int64) for w in view.map())
    return cv2_remap(image, u, v)


def corners(left, right, board):
    """The chessboard's inner corners in both images, (n, 2) each, in one order; None where it is not seen whole."""
    found = [_corners(image, board) for image in (left, right)]
    if found[0] is None or found[1] is None:
        return None
    # The board looks nearly the same upside down: the order is the one in which it moved as a whole.
    turned = found[1][::-1]
    if np.ptp(found[0] - turned, axis=0).sum() < np.ptp(found[0] - found[1], axis=0).sum():
        found[1] = turned
    return found


def _corners(image, board):
    seen, points = cv2.findChessboardCorners(
        image, board, flags=cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    )
    if not seen:
        return None
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-3)
    return cv2.cornerSubPix(image, points, (5, 5), (-1, -1), stop).reshape(-1, 2).astype(np.float64)


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
        row["method"],
        f"{after['pairs']} of {row['pairs']}",
        str(after["points"]),
        f"{before['mean']:.2f}",
        f"{after['mean']:.3f}",
        f"{after['median']:.3f}",
        f"{after['percentile_95']:.3f}",
        f"{after['signed_mean']:+.3f}",
    )


if __name__ == "__main__":
    run(row_difference)
