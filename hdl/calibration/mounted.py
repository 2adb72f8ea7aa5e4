"""Cameras of which a file says how each stands on a body, such as the IMU: two of them as a rig."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from hdl.calibration import motion
from hdl.calibration.rig import Camera, Rig
from hdl.calibration.selection import pair
from hdl.calibration.suspicions import left_first
from hdl.errors import InputError

SELECT = "two cameras by their place in the list, left first, as in 0,1"


@dataclass(frozen=True, eq=False)
class Mounted:
    """One camera on the body.

    Members
    -------
    where : str
        The file that describes it.
    size : (width, height)
        px.
    camera : Camera
    to_body : Motion
        Takes points of the camera to the body; in metres.
    spelled : dict of "camera", "size", "K", "D" and "pose" to str or (file, str)
        What the camera is called, and how the file spells these; with the file where that is another one.
    """

    where: str
    size: tuple[int, int]
    camera: Camera
    to_body: motion.Motion
    spelled: dict

    def place(self, role: str) -> tuple[str, str]:
        spelling = self.spelled[role]
        return spelling if isinstance(spelling, tuple) else (self.where, spelling)


def rig(source: str, left: Mounted, right: Mounted) -> Rig:
    """The rig of two cameras, called left and right as they are given."""
    fields = dict.fromkeys("RT", right.place("pose"))
    for number, mounted in (("1", left), ("2", right)):
        fields |= {role + number: mounted.place(role) for role in ("camera", "size", "K", "D")}
    R, T = motion.between(motion.inverse(left.to_body), motion.inverse(right.to_body))
    cameras = (replace(mounted.camera, size=mounted.size) for mounted in (left, right))
    return Rig(source, *left.size, *cameras, R, T, unit="m", fields=fields)


def numbered(source: str, first: Mounted, second: Mounted) -> Rig:
    """As :func:`rig`; the camera that stands left is called left."""
    return left_first(rig(source, first, second))


def listed(where: str, field: str, entries: list, select: str | None, mount: Callable[[int], Mounted]) -> Rig:
    """The rig of two ``entries`` of a list, the ``field`` of a file: those of ``select``, otherwise the first two.

    Raises InputError if there are not as many.
    """
    if len(entries) < 2:
        raise InputError(where, field, len(entries), "two cameras are needed")
    names = [str(index) for index in range(len(entries))]
    first, second = (mount(int(name)) for name in (pair(select, names) if select is not None else names[:2]))
    return numbered(where, first, second) if select is None else rig(where, first, second)
