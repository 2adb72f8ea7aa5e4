"""A simple rig and what it sees of flat things: chessboards, textures, and walls that repeat themselves."""

import cv2
import numpy as np

from hdl.calibration import Camera, Rig

WIDTH, HEIGHT = 320, 240
FOCAL = 300.0
SIDES = ("left", "right")


def rig(low=0.0, T=(-0.1, 0.0, 0.0)):
    """Parallel cameras without a lens; the right one's principal point is ``low`` px lower."""
    cameras = [Camera("radtan", _matrix(down), np.zeros(0)) for down in (0, low)]
    return Rig("rig.yml", WIDTH, HEIGHT, *cameras, np.eye(3), np.array(T))


def board(columns=9, rows=6, square=40):
    """A chessboard of so many inner corners, with a white margin."""
    squares = np.indices((rows + 1, columns + 1)).sum(axis=0) % 2
    picture = np.where(np.kron(squares, np.ones((square, square))), 230, 20).astype(np.uint8)
    return cv2.copyMakeBorder(picture, *[square] * 4, cv2.BORDER_CONSTANT, value=230)


def texture(seed=4, size=400):
    small = np.random.default_rng(seed).integers(0, 256, (size // 8, size // 8), np.uint8)
    return cv2.resize(small, (size, size), interpolation=cv2.INTER_CUBIC)


def squares(count=30, square=20):
    """A wall of black and white squares, larger than any image of it."""
    picture = np.kron(np.indices((count, count)).sum(axis=0) % 2, np.ones((square, square)))
    return np.where(picture, 230, 20).astype(np.uint8)


def seen(picture, low=0.0, turn=8.0, slant=25.0, distance=1.0, width=0.8, noise=1.0):
    """What `rig` sees of a flat ``picture``, {side: (HEIGHT, WIDTH) uint8}.

    Parameters
    ----------
    low : float
        px that the right image is lower by.
    turn, slant : float
        Degrees, in the picture's plane and of it about the vertical.
    distance, width : float
        m, of the picture's middle and across it.
    noise : float
        Standard deviation, gray levels.
    """
    turned, slanted = np.radians([turn, slant])
    R = cv2.Rodrigues(np.array([0, slanted, 0]))[0] @ cv2.Rodrigues(np.array([0, 0, turned]))[0]
    height, columns = picture.shape
    scale = width / columns
    to_plane = np.array([[scale, 0, -scale * (columns - 1) / 2], [0, scale, -scale * (height - 1) / 2], [0, 0, 1]])
    images = {}
    for seed, (side, x, down) in enumerate((("left", 0.05, 0), ("right", -0.05, low))):
        homography = _matrix(down) @ np.column_stack([R[:, 0], R[:, 1], [x, 0, distance]]) @ to_plane
        fine = np.diag([4.0, 4, 1]) @ homography  # small squares are averaged
        image = cv2.warpPerspective(picture, fine, (4 * WIDTH, 4 * HEIGHT), borderValue=150)
        image = cv2.resize(image, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA).astype(float)
        image += np.random.default_rng(seed).normal(0, noise, image.shape)
        images[side] = np.clip(image, 0, 255).astype(np.uint8)
    return images


def _matrix(low):
    return np.array([[FOCAL, 0, (WIDTH - 1) / 2], [0, FOCAL, (HEIGHT - 1) / 2 + low], [0, 0, 1]])
