"""What is to be said of a rectification: what was changed, how much of the frame it fills, and whether rows agree."""

import numpy as np

from hdl.calibration import stance, suspicions
from hdl.calibration.rig import SIDES, Rig
from hdl.errors import InputError
from hdl.geometry.rectification import (
    LEAST_FILLED,
    MAGNIFIED,
    RectificationOptions,
    helpful,
    magnification,
    rectify,
)
from hdl.geometry.row_minimisation import loss
from hdl.geometry.view import View

POINTS = 2000


def notes(rig: Rig, options: RectificationOptions, views: dict[str, View]) -> list[str]:
    """Lines for a user whose ``options`` turned ``rig`` into ``views``; none if there is nothing unusual."""
    lines = list(rig.notes)
    if (rig.rectification or rig.rectification_fault) and options.given:
        chosen = ", ".join(options.given)
        lines.append(f"{rig.source}: the rectification in the file is not used as it stands, because of {chosen}")
    if views["left"].aligned == "columns":
        lines.append(
            f"{rig.source}: one camera stands above the other, so that a point lies on one column of both rectified "
            "images, not on one row; search down the columns (y_left - y_right = f B / Z), or transpose both images"
        )
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


def warnings(rig: Rig, views: dict[str, View], options: RectificationOptions = RectificationOptions()) -> list[str]:
    """Those of ``rig``, of the rectification in its file where ``options`` leave it in use, and of its ``views``:
    turned or magnified beyond what is usual, empty for the most part, or folded back by their lens."""
    own = bool(rig.rectification) and options.keep_the_files
    lines = [*rig.warnings, *(rig.rectification_warnings if own else ())]
    left, right = (views[side] for side in SIDES)
    shift = right.P[:, 3] - left.P[:, 3]
    exchanged = suspicions.sides(rig)
    if exchanged and shift[stance.along(shift)] > 0 and str(exchanged) not in lines:
        lines.append(str(exchanged))
    if aslant := turned(rig, views, options):
        lines.append(str(aslant))
    times = magnification(rig, left)
    if options.focal is None and options.fov is None and times >= MAGNIFIED:
        found = " or ".join(choice.spelled for choice in helpful(rig))
        turn = stance.largest_turn(rig)
        cause = f", as {turn.cause}" if turn.angle >= stance.UNUSUAL and not own else ""
        advice = f"; {found} shows more" if found else ""
        lines.append(f"{rig.source}: the {_whose(own)} magnifies about {times:.2g} times{cause}{advice}")
    for number, side in enumerate(SIDES, start=1):
        filled = views[side].inside.mean()
        if filled < LEAST_FILLED:
            problem = f"only {100 * filled:.0f} % of the rectified {side} frame has a source in the image"
            lines.append(str(rig.fault(f"P{number}", views[side].P, problem)))
        if folded := views[side].folded():
            problem = f"the lens folds back in the rectified frame: {100 * folded:.1f} % of it show the image twice"
            lines.append(str(rig.fault(f"D{number}", views[side].camera.D, problem)))
    return lines


def turned(rig: Rig, views: dict[str, View], options: RectificationOptions) -> InputError | None:
    """What is to be said of rectified images that are turned against the source's, which costs line memory; not raised.

    None where they are not; ``views`` are those of ``rig`` and ``options``.
    """
    turns = {side: stance.turn_about_view(view.R) for side, view in views.items()}
    side = max(turns, key=lambda side: abs(turns[side]))
    angle = abs(turns[side])
    if angle < stance.UNUSUAL:
        return None
    own = bool(rig.rectification) and options.keep_the_files
    which = "images" if min(map(abs, turns.values())) > angle / 2 else f"{side} images"
    culprit, cause = views[side].geometry, ""
    if not own:
        left, right = turns.values()
        apart, together = abs(left - right), abs(left + right) / 2
        if apart > together:
            culprit = "R", rig.R
            cause = f", as the cameras are turned by {apart:.0f} degrees about the view against each other"
        else:
            culprit = "T", rig.T
            cause = f", as the baseline lies {together:.0f} degrees aslant in the images"
    problem = (
        f"the {_whose(own)} turns the {which} by {stance.in_words(angle)}{cause}, which costs {_memory(views[side])}"
    )
    others = [choice for choice in helpful(rig) if _turn(rectify(rig, choice, lens=True)) < angle / 2]
    remedies = [choice.spelled for choice in others]
    if angle > 135 and not stance.left_is_left(rig):
        remedies.append("exchanged cameras")
    if remedies:
        problem += f"; {' or '.join(remedies)} do without"
    return rig.fault(*culprit, problem)


def _turn(views):
    return max(abs(stance.turn_about_view(view.R)) for view in views.values())


def _memory(view):
    rows, height = view.window.rows, view.source_size[1]
    if rows < height:
        return f"{rows} rows of line buffer"
    return "two frames of memory" if rows > 1.5 * height else "a frame of memory"


def _whose(own):
    return "rectification in the file" if own else "computed rectification"


def row_disagreement(rig: Rig, views: dict[str, View]) -> float:
    """By how many px, at most, the rectified rows of one point differ between the cameras, or the columns where these
    are aligned; 0 for exact geometry.

    Random points, the same ones on every call: anywhere in the left rectified frame, 10 to 1000 baselines away. They
    take the way through R and T of the rig, so that a rectification of other cameras shows.
    """
    rng = np.random.default_rng(0)
    left, right = (views[side] for side in SIDES)
    y = rng.uniform(0, left.height - 1, POINTS)
    x = rng.uniform(0, left.width - 1, POINTS)
    rays = left.ray @ [x, y, np.ones(POINTS)]
    points = rays * np.linalg.norm(rig.T) * 10 * 100 ** rng.uniform(0, 1, POINTS)
    column, row, z = right.P[:, :3] @ right.R @ (rig.R @ points + rig.T[:, None])
    return float(np.abs(row / z - y if left.aligned == "rows" else column / z - x).max())
