"""One rectified camera and its exact map: where in the source image every rectified pixel comes from, in float64.

The map agrees with cv2.initUndistortRectifyMap and cv2.fisheye.initUndistortRectifyMap to the precision of those, which
is float32, except that a skew in K, which OpenCV leaves out, takes part.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from hdl.arithmetic.bands import banded, bands
from hdl.calibration.rig import SIDES, Camera
from hdl.errors import InputError
from hdl.geometry.coordinates import Border, Coordinates, Window, inside_image
from hdl.lens import LENS_MODELS

# No core addresses coordinates further out; a lens polynomial beyond its poles and a view along the image plane do.
FARTHEST = 1 << 20  # px
_CHUNK = 1 << 15  # pixels at a time: the intermediate arrays then stay in the cache


@dataclass(frozen=True, eq=False)
class View:
    """One rectified camera.

    Members
    -------
    side : str
        "left" or "right".
    camera : Camera
        The source camera. One that states no size takes images of the rectified image's.
    R : (3, 3) float64
        Rectifying rotation, from the source camera to the rectified one.
    P : (3, 4) float64
        Projection of the rectified camera, px.
    width, height : int
        Size of the rectified image, px.
    lens : bool
        Whether the map contains the lens. Without it, it is the homography of Eq. 2.
    aligned : str
        "rows" or "columns": which of a point agree in both rectified images of the pair.
    origin : str
        Where R and P come from, in words.
    entry : str
        Which entry of which file describes the camera, in words; "" where there is none.
    unit : str or None
        "m" where the unit of the baseline in P is known.
    before : View or None
        What it was before its rows were minimised.
    geometry : (str, array)
        For messages: the role of the field that R follows from, and its value.
    fault : callable
        For messages: Rig.fault of the rig that the view is of.
    """

    side: str
    camera: Camera
    R: np.ndarray
    P: np.ndarray
    width: int
    height: int
    lens: bool
    aligned: str = "rows"
    origin: str = "given"
    entry: str = ""
    unit: str | None = None
    before: "View | None" = field(default=None, repr=False)
    geometry: tuple[str, np.ndarray | None] = field(default=("R", None), repr=False)
    fault: Callable[..., InputError] = field(default=partial(InputError, None), repr=False)

    @property
    def source_size(self) -> tuple[int, int]:
        """(width, height) of the source image, px."""
        return self.camera.size or (self.width, self.height)

    @cached_property
    def ray(self) -> np.ndarray:
        """(3, 3) float64: takes a rectified pixel (xr, yr, 1) to its ray in the source camera's axes.

        (P R)^-1 and not R^T P^-1, as in OpenCV: the two differ where a file rounds R.
        """
        return np.linalg.inv(self.P[:, :3] @ self.R)

    @property
    def homography(self) -> np.ndarray:
        """(3, 3) float64: C = K R^T P^-1, which takes (xr, yr, 1) to (x, y, z) with u = x/z, v = y/z (Eq. 1-3).

        K is that of the camera without its lens."""
        return self.camera.pinhole @ self.ray

    def project(self, xr: np.ndarray, yr: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Source coordinates (u, v), px, float64, of rectified pixels; xr and yr of any shapes that broadcast."""
        matrix = self.ray if self.lens else self.homography
        x, y, z = (row[0] * xr + (row[1] * yr + row[2]) for row in matrix)
        x /= z
        y /= z
        if not self.lens:
            return x, y
        x, y = LENS_MODELS[self.camera.model].distort(x, y, self.camera.D)
        (fx, skew, cx), (_, fy, cy), _ = self.camera.K
        u = x * fx
        if skew:
            u += skew * y
        u += cx
        v = y * fy
        v += cy
        return u, v

    def map(self) -> tuple[np.ndarray, np.ndarray]:
        """Source coordinates (u, v), px, read-only float64 arrays of shape (height, width). Computed once.

        Raises InputError if no pixel of the rectified image comes from inside the source image, or if one comes from
        farther out than any core can address or along a ray that the lens model is not defined for.
        """
        return self._map

    @cached_property
    def _map(self) -> tuple[np.ndarray, np.ndarray]:
        u, v = (np.empty((self.height, self.width)) for _ in range(2))
        xr = np.arange(self.width, dtype=np.float64)
        step = max(1, _CHUNK // self.width)

        def fill(top: int) -> tuple[bool, float]:
            rows = slice(top, min(top + step, self.height))
            yr = np.arange(rows.start, rows.stop, dtype=np.float64)[:, None]
            with np.errstate(all="ignore"):  # what overflows is refused below
                part_u, part_v = self.project(xr, yr)
            u[rows], v[rows] = part_u, part_v
            inside = inside_image(part_u, part_v, *self.source_size)
            farthest = max(np.abs(part_u, out=part_u).max(), np.abs(part_v, out=part_v).max())
            return bool(inside.any()), float(farthest)

        with ThreadPoolExecutor() as pool:
            parts = list(pool.map(fill, range(0, self.height, step)))
        if any(np.isnan(farthest) for _, farthest in parts):
            raise self._refusal(
                f"the rectified {self.side} frame shows rays that the lens model {self.camera.model} is not defined "
                "for; a larger --focal or a smaller --fov leaves them out"
            )
        if not all(farthest <= FARTHEST for _, farthest in parts):
            raise self._refusal(f"the map of the {self.side} camera leads to infinity")
        if not any(inside for inside, _ in parts):
            raise self._refusal(f"no pixel of the rectified {self.side} image comes from inside the source image")
        u.setflags(write=False)
        v.setflags(write=False)
        return u, v

    def _refusal(self, problem: str) -> InputError:
        if not self.lens:
            return self.fault(*self.geometry, problem)
        replace(self, lens=False).map()  # raises if the lens is not to blame
        return self.fault(f"D{1 + SIDES.index(self.side)}", self.camera.D, problem)

    def nearest(self) -> float:
        """The least z of (x, y, z) over the rectified frame; z is affine in xr and yr, so a corner has it."""
        xr, yr = np.meshgrid([0, self.width - 1], [0, self.height - 1])
        return (self.ray[2, 0] * xr + self.ray[2, 1] * yr + self.ray[2, 2]).min()

    @cached_property
    def window(self) -> Window:
        """The source rows that an output row needs, over the taps of every pixel of the float64 map.

        A core rounds its coordinates, and may need a row more at either end.
        """
        whole = ((lambda rows, w=w: np.floor(w[rows])) for w in self.map())
        return Coordinates.banded((self.height, self.width), 0, *whole).window(Border(), self.source_size)

    @property
    def distortion(self) -> tuple[np.ndarray, np.ndarray]:
        """(u, v) with the lens less (u, v) without it, px: (n,) arrays over the pixels whose source, with the lens, is
        inside the source image. Raises InputError as :meth:`map` of the view with the lens does."""
        lens, plain = (self if self.lens == wanted else replace(self, lens=wanted) for wanted in (True, False))
        inside = lens.inside
        return tuple((bent - straight)[inside] for bent, straight in zip(lens.map(), plain.map()))

    def folded(self) -> float:
        """The share of the pixels with a source inside the source image at which the map turns back on itself, so that
        the image is shown twice: where its Jacobian is not positive, by differences to the next pixel."""
        folded, total = 0, 0
        for rows in bands((self.height - 1, self.width)):
            u, v = (w[rows.start : rows.stop + 1] for w in self.map())
            along_u, along_v = (np.diff(w[:-1], axis=1) for w in (u, v))
            down_u, down_v = (w[1:, :-1] - w[:-1, :-1] for w in (u, v))
            inside = self.inside[rows, :-1]
            total += int(np.count_nonzero(inside))
            folded += int(np.count_nonzero((along_u * down_v <= down_u * along_v) & inside))
        return folded / total if total else 0.0

    @cached_property
    def inside(self) -> np.ndarray:
        """(height, width) bool: which rectified pixels come from inside the source image."""
        u, v = self.map()
        return banded(u.shape, bool, lambda rows: inside_image(u[rows], v[rows], *self.source_size))
