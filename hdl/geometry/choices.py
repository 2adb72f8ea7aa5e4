"""What the user chooses of a rectification."""

import math
from dataclasses import dataclass

from hdl.errors import InputError

MAX_FOV_LOSS = 0.05


@dataclass(frozen=True)
class RectificationOptions:
    """What the user chooses of the rectification, each by its command-line name; None: not chosen.

    Parameters
    ----------
    alpha : float
        As cv2.stereoRectify's: 0 shows no pixel without a source, 1 loses no source pixel. It is a choice of the focal
        length, which cameras with a lens that cv2.stereoRectify does not know do not have; 0 where nothing else
        chooses it.
    focal : float
        Focal length of both rectified views, px.
    fov : float
        In place of ``focal``: horizontal field of view of the rectified frame, outer edge to outer edge, degrees.
    center : (x, y)
        Principal point of both rectified views, px, inside the frame.
    minimise : "rows"
        Choose what is left free so that the line buffers are smallest; see `hdl.geometry.row_minimisation`.
    max_fov_loss : float
        With ``minimise``: the share of the field of view that it may give up, 0 to 0.5; `MAX_FOV_LOSS` if not chosen.

    Raises
    ------
    InputError
        For a value outside its range, where two of alpha, focal and fov are given, and for max_fov_loss without
        minimise.
    """

    alpha: float | None = None
    focal: float | None = None
    center: tuple[float, float] | None = None
    fov: float | None = None
    minimise: str | None = None
    max_fov_loss: float | None = None

    def __post_init__(self):
        for name, fits, needed in (
            ("alpha", lambda x: 0 <= x <= 1, "a number from 0 to 1"),
            ("focal", lambda x: 0 < x < math.inf, "a positive number of pixels"),
            ("fov", lambda x: 0 < x < 180, "an angle between 0 and 180 degrees"),
            ("max_fov_loss", lambda x: 0 <= x <= 0.5, "a share from 0 to 0.5"),
        ):
            value = getattr(self, name)
            if value is not None and not fits(value):
                raise InputError(_option(name), None, value, f"{needed} is needed")
        if self.minimise not in (None, "rows"):
            raise InputError("--minimise", None, self.minimise, "rows is what can be minimised")
        if self.max_fov_loss is not None and not self.minimise:
            problem = "what --minimise rows may lose of the view; nothing is minimised without it"
            raise InputError("--max-fov-loss", None, self.max_fov_loss, problem)
        first, *others = [name for name in ("alpha", "focal", "fov") if getattr(self, name) is not None] or [None]
        if others:
            problem = f"{_option(first)} chooses the focal length already; keep one of them"
            raise InputError(_option(others[0]), None, getattr(self, others[0]), problem)

    @property
    def given(self) -> list[str]:
        """The choices that were made, as the command line spells them. With one, a file's own rectification is out."""
        names = ("alpha", "focal", "center", "fov", "minimise")
        return [_option(name) for name in names if getattr(self, name) is not None]

    @property
    def allowed_loss(self) -> float:
        """What minimising may give up of the view: ``max_fov_loss``, or its default."""
        return MAX_FOV_LOSS if self.max_fov_loss is None else self.max_fov_loss

    @property
    def spelled(self) -> str:
        """The choices as the command line spells them, values and all; for numbers that choose a view."""
        center = ["--center {:g},{:g}".format(*self.center)] if self.center else []
        numbers = [f"{_option(name)} {value:g}" for name in ("alpha", "focal", "fov")
                   if (value := getattr(self, name)) is not None]  # fmt: skip
        return " ".join(numbers + center)

    @property
    def keep_the_files(self) -> bool:
        """Whether a rectification that the file carries is used, as it stands or as what minimising starts from."""
        return self.given in ([], ["--minimise"])


def _option(name):
    return "--" + name.replace("_", "-")
