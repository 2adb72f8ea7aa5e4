"""Points that two real images both show, found without knowing where they should be."""

import cv2
import numpy as np

from sim.alignment import RowDifference

FEATURES = 4000
RATIO = 0.75  # of the distance to the best match to that to the second best (Lowe 2004)
EPIPOLAR_TOLERANCE = 1.0  # px


def features(left, right):
    """Matched SIFT features of both images, (height, width) uint8: (n, 2) each, px, or None where there are too few.

    Matches are each other's best, clearly better than the second, and agree with one fundamental matrix that is
    estimated from them alone: it does not know which rows the points should be on.
    """
    detector = cv2.SIFT_create(FEATURES)
    (kept_left, described_left), (kept_right, described_right) = (
        detector.detectAndCompute(image, None) for image in (left, right)
    )
    if any(described is None or len(described) < 2 for described in (described_left, described_right)):
        return None
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    back = {match.queryIdx: match.trainIdx for match in matcher.match(described_right, described_left)}
    matches = [
        best
        for best, second in matcher.knnMatch(described_left, described_right, k=2)
        if best.distance < RATIO * second.distance and back[best.trainIdx] == best.queryIdx
    ]
    if len(matches) < 16:
        return None
    points = [
        np.array([kept_left[match.queryIdx].pt for match in matches]),
        np.array([kept_right[match.trainIdx].pt for match in matches]),
    ]
    _, inliers = cv2.findFundamentalMat(*points, cv2.USAC_MAGSAC, EPIPOLAR_TOLERANCE, 0.9999, 10000)
    return None if inliers is None else [side[inliers.ravel() > 0] for side in points]


def matched_rows(left, right, aligned="rows"):
    """`RowDifference` of the `features` of two frames, (height, width) or with 3 channels, uint8; None without any.

    ``aligned``: "rows" or "columns", whichever is to be compared.
    """
    points = features(
        *(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image for image in (left, right))
    )
    if points is None or not len(points[0]):
        return None
    axis = ("columns", "rows").index(aligned)
    apart = np.abs(points[0][:, axis] - points[1][:, axis])
    return RowDifference(float(apart.mean()), float(apart.max()), len(apart))
