"""Common video formats, and by what margin a core meets their pixel clocks."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Format:
    """A video format.

    Members
    -------
    name : str
    width, height : int
        Of the frame, px.
    hz : int
        Frames a second.
    mhz : float
        Its pixel clock, blanking included.
    """

    name: str
    width: int
    height: int
    hz: int
    mhz: float


# Source: VESA DMT 1.0 Rev. 13 for those of computers; CEA-861 for 720p60 (code 4), 1080p30 (34) and 1080p60 (16).
FORMATS = (
    Format("VGA", 640, 480, 60, 25.175),
    Format("SVGA", 800, 600, 60, 40.0),
    Format("XGA", 1024, 768, 60, 65.0),
    Format("720p", 1280, 720, 60, 74.25),
    Format("1080p", 1920, 1080, 30, 74.25),
    Format("SXGA", 1280, 1024, 60, 108.0),
    Format("1080p", 1920, 1080, 60, 148.5),
)


@dataclass(frozen=True)
class Margin:
    """How a clock compares with a format's.

    Members
    -------
    format : Format
    share : float
        By how much it is higher, of the format's; negative where it is lower.
    """

    format: Format
    share: float

    @property
    def met(self):
        return self.share >= 0


def margins(mhz):
    """The `Margin` of each of `FORMATS` at a highest clock, MHz, of one pixel a clock."""
    if not mhz > 0:
        raise ValueError(f"mhz = {mhz}: must be positive")
    return [Margin(one, mhz / one.mhz - 1) for one in FORMATS]
