"""ROS camera_info messages as printed from their topics, of one camera a file or of both in one, between lines of ---.

ROS 2 prints d, k, r and p, ROS 1 D, K, R and P. A message that was printed more than once counts once.
Source: sensor_msgs/CameraInfo; ros2 topic echo and rostopic echo.
"""

import re

from hdl.calibration.documents import Document
from hdl.calibration.fields import Fields
from hdl.calibration.rig import Rig
from hdl.calibration.ros import Info, pair
from hdl.errors import InputError

NAME = "ros-message"
TITLE = "ROS camera_info messages, as printed from the topics"
SEVERAL_FILES = True
SELECT = None

_TRAITS = [re.compile(rf"^{field}[ \t]*:", re.MULTILINE) for field in ("[Kk]", "[Pp]", "height")]


def recognises(document: Document) -> bool:
    return all(trait.search(document.text) for trait in _TRAITS)


def read(documents: list[Document], size: tuple[int, int] | None, select: None) -> Rig:
    """The rig in one document or two. Raises InputError as `ros` does, and unless there are two cameras in all."""
    infos = []
    for document in documents:
        messages = _messages(document)
        for number, content in enumerate(messages, start=1):
            fields = Fields(document.name, content, f"message {number}" if len(messages) > 1 else "")
            infos.append(Info(fields, _spelled(content), _name(fields)))
    if len(infos) != 2:
        source = ", ".join(document.name for document in documents)
        raise InputError(source, None, f"{len(infos)} camera_info messages", "two are needed, one of each camera")
    return pair(", ".join(document.name for document in documents), infos)


def _spelled(content):
    letters = "KDRP" if "K" in content else "kdrp"
    return dict(zip("KDRP", letters)) | {"size": ("width", "height"), "lens": ("distortion_model",)}


def _name(fields):
    header = fields.get("header") if "header" in fields else None
    found = isinstance(header, dict) and "frame_id" in header
    return (fields.name("header.frame_id"), header["frame_id"]) if found else None


def _messages(document):
    """The messages in a file, but for those that repeat one before them, apart from the time."""
    messages = []
    for part in document.parts:
        numbers = {key: value for key, value in part.yaml.items() if key != "header"}
        if all(numbers != {key: value for key, value in other.items() if key != "header"} for other in messages):
            messages.append(part.yaml)
    return messages
