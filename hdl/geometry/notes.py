"""What is to be said of a rectification: what was changed, how much of the frame it fills, and whether rows agree."""

import numpy as np

from hdl.calibration.rig import SIDES, Rig
from hdl.geometry.rectification import RectificationOptions
from hdl.geometry.row_minimisation import loss
from hdl.geometry.view import View

POINTS = 2000
LEAST_FILLED = 0.5  # share of the frame; rectified frames as people choose them are filled by more than two thirds


def notes(rig: Rig, options: RectificationOptions, views: dict[str, View]) -> list[str]:
    """Lines for a user whose ``options`` turned ``rig`` into ``views``; none if there is nothing unusual."""
    lines = list(rig.notes)
    if (rig.rectification or rig.rectification_fault) and options.given:
        chosen = ", ".join(options.given)
        lines.append(f"{rig.source}: the rectification in the file is not used as it stands, because of {chosen}")
    if options.minimise:
        before = {side: view.before for side, view in views.items()}
        counts = [" + ".join(str(pair[side].window.rows) for side in SIDES) for pair in (before, views)]
        lines.append(
            f"--minimise rows: line buffers of {counts[0]} rows, left + right, become {counts[1]}; "
            f"{100 * loss(before, views):.1f} % of the view is lost, "
            + " and ".join(f"{100 * views[side].inside.mean():.1f} %" for side in SIDES)
            + " of the frames have a source"
        )
    return lines


def warnings(rig: Rig, views: dict[str, View]) -> list[str]:
    """Those of ``rig``, and of its ``views``: empty for the most part, or folded back by their lens."""
    lines = list(rig.warnings)
    for number, side in enumerate(SIDES, start=1):
        filled = views[side].inside.mean()
        if filled < LEAST_FILLED:
            problem = f"only {100 * filled:.0f} % of the rectified {side} frame has a source in the image"
            lines.append(str(rig.fault(f"P{number}", views[side].P, problem)))
        if folded := views[side].folded():
            problem = f"the lens folds back in the rectified frame: {100 * folded:.1f} % of it show the image twice"
            lines.append(str(rig.fault(f"D{number}", views[side].camera.D, problem)))
    return lines


def row_disagreement(rig: Rig, views: dict[str, View]) -> float:
    """By how many px, at most, the rectified rows of one point differ between the cameras; 0 for exact geometry.

    Random points, the same ones on every call: anywhere in the left rectified frame, 10 to 1000 baselines away. They
    take the way through R and T of the rig, so that a rectification of other cameras shows.
    """
    rng = np.random.default_rng(0)
    left, right = (views[side] for side in SIDES)
    y = rng.uniform(0, left.height - 1, POINTS)
    rays = left.ray @ [rng.uniform(0, left.width - 1, POINTS), y, np.ones(POINTS)]
    points = rays * np.linalg.norm(rig.T) * 10 * 100 ** rng.uniform(0, 1, POINTS)
    _, row, z = right.P[:, :3] @ right.R @ (rig.R @ points + rig.T[:, None])
    return float(np.abs(row / z - y).max())
