"""Chessboards of any size in two images: their inner corners, and which is which in the other image."""

import cv2
import numpy as np

LEAST_CORNERS = 20  # of a board, as 5x4: smaller patterns are found in textures too
_SEED = 4, 3  # corners of the smallest pattern that detection starts from; it grows as far as the board goes
_WIDEST = 1400  # px: larger images are looked through at a fraction of their size
_QUADRANT = 0.3  # of a square: how far from a corner the four squares around it are looked at
_FAINT = 0.2  # of the usual contrast across a corner


def chessboard(left, right, positions):
    """The inner corners of the board that two gray images show: ((columns, rows), left, right), (n, 2) px each.

    None unless both show all of one board, of whatever size. A pattern counts only if the four squares around each of
    its corners are dark and bright in turn, and if in one of the images it is seen to end on all sides: two parts of a
    board that is cut off look alike and are not.

    Parameters
    ----------
    left, right : (height, width) uint8
    positions : pair of callables
        From (n, 2) px of the left, of the right, image to (n, 2) px in which corners have about one order and distance
        in both, as after rectification; NaN for points that are not shown. They tell which of a board's ends is which.
    """
    images = (left, right)
    for size in sorted(set().union(*map(_sizes, images)), key=np.prod, reverse=True):
        grids = [_grid(image, size) for image in images]
        if any(grid is None for grid in grids):
            continue
        ends = [_ends(image, grid) for image, grid in zip(images, grids)]
        if None in ends or not any(ends):
            continue
        turned = _as_in_left(images, grids, positions)
        if turned is not None:
            return size, *(grid.reshape(-1, 2) for grid in (grids[0], turned))
    return None


def _small(image):
    """The image at a size that detection is quick at, and px of it per px of the result."""
    scale = -(-max(image.shape) // _WIDEST)
    if scale == 1:
        return image, 1
    height, width = image.shape[0] // scale, image.shape[1] // scale
    return cv2.resize(image[: height * scale, : width * scale], (width, height), interpolation=cv2.INTER_AREA), scale


def _sizes(image):
    """What the pattern in an image may be, as (columns, rows), the longer side first."""
    flags = cv2.CALIB_CB_LARGER | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, _, pattern = cv2.findChessboardCornersSBWithMeta(_small(image)[0], _SEED, flags)
    size = tuple(sorted(pattern.shape[:2], reverse=True)) if found else (0, 0)
    return {size} if np.prod(size) >= LEAST_CORNERS else set()


def _grid(image, size):
    """The corners of a pattern of that size, (rows, columns, 2) px, columns to the right of rows; None if it is not
    there, or is something else."""
    small, scale = _small(image)
    found, corners = cv2.findChessboardCornersSB(small, size, cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY)
    if not found:
        flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
        found, corners = cv2.findChessboardCorners(small, size, flags=flags)
    if not found:
        return None
    grid = (corners.reshape(size[1], size[0], 2) + 0.5) * scale - 0.5
    if not ((grid >= 0) & (grid <= np.array(image.shape[::-1]) - 1)).all():
        return None
    across, down = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    if across[0] * down[1] < across[1] * down[0]:
        grid = grid[:, ::-1]
    grid = _refined(image, grid, 5 * scale)
    contrast = _contrast(image, grid)
    if not (contrast.min() > _FAINT * np.median(contrast) or contrast.max() < _FAINT * np.median(contrast)):
        return None
    return grid


def _refined(image, grid, farthest):
    """To fractions of a pixel, looking no further than ``farthest`` px and a third of a square."""
    nearest = min(np.linalg.norm(np.diff(grid, axis=axis), axis=2).min() for axis in (0, 1))
    reach = int(np.clip(nearest / 3, 2, farthest))
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-3)
    corners = np.ascontiguousarray(grid.reshape(-1, 1, 2), dtype=np.float32)
    return cv2.cornerSubPix(image, corners, (reach, reach), (-1, -1), stop).reshape(grid.shape).astype(np.float64)


def _contrast(image, grid):
    """How much brighter the squares to the lower right and upper left of each corner are than the other two, counted
    the other way round at every second corner: of one sign all over a chessboard. 0 where the four are not dark and
    bright in turn, NaN where one is outside the image. (rows, columns)"""
    across, down = np.gradient(grid, axis=1), np.gradient(grid, axis=0)
    blurred = cv2.GaussianBlur(image, (3, 3), 0).astype(np.float32)
    height, width = image.shape

    def square(x, y):
        at = (grid + _QUADRANT * (x * across + y * down)).astype(np.float32)
        value = cv2.remap(blurred, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        inside = ((at >= 0) & (at <= [width - 1, height - 1])).all(axis=2)
        return np.where(inside, value, np.nan)

    one, other = ((square(1, sign), square(-1, -sign)) for sign in (1, -1))
    brighter = np.minimum(*one) - np.maximum(*other)
    darker = np.minimum(*other) - np.maximum(*one)
    found = np.where(brighter > 0, brighter, np.where(darker > 0, -darker, brighter * 0))
    return found * (-1.0) ** np.indices(found.shape).sum(axis=0)


def _ends(image, grid):
    """Whether the board is seen to end on all four sides, in part of each at least; None where it goes on beyond the
    grid."""
    around = np.pad(grid, ((1, 1), (1, 1), (0, 0)), mode="reflect", reflect_type="odd")
    contrast = _contrast(image, around)
    usual = np.median(contrast[1:-1, 1:-1])
    sides = [contrast[0, 1:-1], contrast[-1, 1:-1], contrast[1:-1, 0], contrast[1:-1, -1]]
    sides = [side[~np.isnan(side)] / usual > _FAINT for side in sides]
    if any(side.size and side.mean() > 0.5 for side in sides):
        return None
    return all(side.size > 1 for side in sides)


def _as_in_left(images, grids, positions):
    """The right image's grid in the left one's order: the turn under which squares keep their colours and, of several,
    the board moves most as a whole. None if there is none, or the board is not shown."""
    left, right = grids
    place = [shown(grid.reshape(-1, 2)).reshape(grid.shape) for shown, grid in zip(positions, grids)]
    square = left.shape[0] == left.shape[1]
    colour = np.median(_contrast(images[0], left)) > 0
    best = None
    for turns in range(4) if square else (0, 2):
        turned = np.rot90(right, turns)
        if (np.median(_contrast(images[1], turned)) > 0) != colour:
            continue
        moved = place[0] - np.rot90(place[1], turns)
        moved = moved[~np.isnan(moved).any(axis=2)]
        if len(moved) >= LEAST_CORNERS // 2:
            spread = np.ptp(moved, axis=0).sum()
            best = min(best or (np.inf, None), (spread, turns))
    return best and np.rot90(right, best[1])
