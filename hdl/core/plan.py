"""The plan: what was built and how exact it is, for machines to read (DESIGN section 7)."""

import hashlib
import json
import re
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

PLAN_VERSION = 4

Row3 = Annotated[list[float], Field(min_length=3, max_length=3)]
Matrix3x3 = Annotated[list[Row3], Field(min_length=3, max_length=3)]
Row4 = Annotated[list[float], Field(min_length=4, max_length=4)]
Matrix3x4 = Annotated[list[Row4], Field(min_length=3, max_length=3)]


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class CameraEntry(_Entry):
    """The camera whose images the core takes: the entry of the file that it was read from; K and D for images of the
    size of `SourceEntry`, in px."""

    side: Literal["left", "right"]
    source: str
    model: str
    K: Matrix3x3
    D: list[float]


class SourceEntry(_Entry):
    """Size of the source image, px."""

    width: int
    height: int


class MinimisedEntry(_Entry):
    """Source rows that the float64 map needs before and after the rectification was chosen for few; the share of the
    view that this cost."""

    rows_before: int
    rows_after: int
    lost: float


class RectificationEntry(_Entry):
    """R rotates the camera's frame into the rectified one, P projects that to rectified px, the baseline in it in
    ``unit``. A point lies on one row of both rectified images, or on one column: what is ``aligned``."""

    R: Matrix3x3
    P: Matrix3x4
    unit: Literal["m"] | None
    aligned: Literal["rows", "columns"]
    origin: str
    minimised: MinimisedEntry | None


class BorderEntry(_Entry):
    mode: Literal["constant", "replicate"]
    value: int


class LineBufferEntry(_Entry):
    """Source rows kept, and the least and greatest (source row - output row) that is read."""

    rows: int
    d_lo: int
    d_hi: int


class PipelineEntry(_Entry):
    """The pipeline, and the clock (MHz) that cores like this one reached, and on what basis."""

    name: str
    mhz: float
    basis: str


class Statistics(_Entry):
    """Mean and greatest magnitude, px."""

    mean: float
    max: float


class AxesEntry(_Entry):
    u: Statistics
    v: Statistics


class ErrorEntry(_Entry):
    """The hardware's coordinates against the float64 map, over the ``pixels`` whose exact source is in the image."""

    u: Statistics
    v: Statistics
    euclidean_max: float
    pixels: int
    rounded: AxesEntry


class CostEntry(_Entry):
    """The coordinate hardware's estimated cost: 7-series cells."""

    lut: int
    ff: int
    ramb18: int
    dsp: int


class ConsideredEntry(_Entry):
    """A datapath that was a candidate: its largest error (px; null where it could not be built), and what became
    of it."""

    datapath: str
    error: float | None
    cost: CostEntry | None
    verdict: str


class Plan(_Entry):
    """One core. Lengths in px, matrices row by row, formats as Qi.f (UQi.f: unsigned).

    ``width`` and ``height`` are the rectified image's.
    ``distortion_dropped`` is what a core without the lens leaves out: how far the lens moves the source of a pixel;
    null where nothing is left out. ``versions`` are those of the programs that decide the text.
    """

    plan_version: Literal[4]
    top: str
    camera: CameraEntry
    rectification: RectificationEntry
    source: SourceEntry
    width: int
    height: int
    lens: bool
    distortion_dropped: AxesEntry | None
    datapath: str
    dsp: bool
    pipeline: PipelineEntry
    optimise: str
    fraction_bits: int
    pixel_bits: int
    channels: int
    border: BorderEntry
    line_buffer: LineBufferEntry
    latency_cycles: int
    formats: dict[str, str]
    cost: CostEntry
    max_error_requested: float | None
    error: ErrorEntry
    considered: list[ConsideredEntry]
    versions: dict[str, str]
    verilog_sha256: str
    plan_sha256: str

    @classmethod
    def sealed(cls, **fields: Any) -> "Plan":
        """The plan of these ``fields`` with its own ``plan_sha256``, by which a later change shows."""
        plan = cls(**fields, plan_sha256="")
        return plan.model_copy(update={"plan_sha256": plan.digest()})

    def digest(self) -> str:
        """SHA-256 of all but ``plan_sha256``."""
        content = json.dumps(self.model_dump(exclude={"plan_sha256"}), sort_keys=True)
        return hashlib.sha256(content.encode()).hexdigest()

    def to_json(self) -> str:
        """JSON text, one matrix row a line."""
        text = json.dumps(self.model_dump(), indent=2)
        return re.sub(r"\[[^\[\]{}]*\]", lambda row: " ".join(row.group().split()), text) + "\n"
