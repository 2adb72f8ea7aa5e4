"""Points that two images of any scene both show, found without knowing on which rows they should be."""

import cv2
import numpy as np

FEATURES = 4000
RATIO = 0.75  # of the distance to the best match to that to the second best (Lowe 2004)
# Distance of descriptors, which are some 512 long, from which on two features are not alike. What looks like something
# else in the image, as squares on a wall do, is easily taken for it, and many such mistakes can agree with one another.
UNLIKE = 200.0


def matches(left, right):
    """SIFT features of two gray images, (height, width) uint8, that are each other's best match, seen from either
    clearly better than the second best, and not like that: two (n, 2) float64, px."""
    detector = cv2.SIFT_create(FEATURES)
    (kept_left, described_left), (kept_right, described_right) = (
        detector.detectAndCompute(image, None) for image in (left, right)
    )
    if any(described is None or len(described) < 2 for described in (described_left, described_right)):
        return np.zeros((0, 2)), np.zeros((0, 2))
    products = described_left @ described_right.T
    apart = (described_left**2).sum(axis=1)[:, None] + (described_right**2).sum(axis=1) - 2 * products
    there, back = _distinct(apart), _distinct(apart.T)
    both = np.flatnonzero((there >= 0) & (back[there] == np.arange(len(there))))
    return tuple(
        np.array([kept[index].pt for index in chosen], np.float64).reshape(-1, 2)
        for kept, chosen in ((kept_left, both), (kept_right, there[both]))
    )


def _distinct(apart):
    """The nearest column of each row, by squared distances; -1 where the second nearest is near, too."""
    best, second = np.partition(apart, 1, axis=1)[:, :2].T
    return np.where((best < RATIO**2 * second) & (second > UNLIKE**2), apart.argmin(axis=1), -1)
