"""The block diagram, with a core's own numbers: where boxes and arrows are, for wide and for narrow pages."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Box:
    """A block: place and size, name, and lines of text."""

    x: int
    y: int
    width: int
    height: int
    name: str
    lines: list


@dataclass(frozen=True)
class Arrow:
    """A path with its head at the end, and a label: text, place, anchor."""

    path: str
    label: str
    x: int
    y: int
    anchor: str = "middle"


@dataclass(frozen=True)
class Diagram:
    """One layout: size of the drawing, boxes, arrows."""

    kind: str
    width: int
    height: int
    boxes: list
    arrows: list


def diagrams(cores):
    """The two layouts, for wide and narrow pages; ``cores``: {side: Core}. Where the cameras differ both numbers are
    given, left | right."""
    texts = _texts(cores.values())
    return [_wide(texts), _narrow(texts)]


def _texts(cores):
    plans = [core.plan for core in cores]
    buffers = [core.parameters.line_buffer for core in cores]
    paths = [core.parameters.datapath for core in cores]
    plan = plans[0]
    pixel = f"{plan.channels} x {plan.pixel_bits} bit" if plan.channels > 1 else f"{plan.pixel_bits} bit"
    return {
        "capture": [f"{plan.width} x {plan.height} px", pixel],
        "line buffer": [
            f"{_both(b.rows for b in buffers)} rows, {_both(f'{b.bits / 8192:.0f}' for b in buffers)} KiB",
            f"4 banks of {_both(b.depth for b in buffers)}",
            f"D {_both(f'{p.line_buffer.d_lo:+d}..{p.line_buffer.d_hi:+d}' for p in plans)}",
        ],
        "bilinear": ["2x2 taps", f"fractions of {plan.fraction_bits} bits"],
        "row flow": [f"lead {_both(b.window.lead for b in buffers)} rows"],
        "raster": [f"x 0..{plan.width - 1}", f"y 0..{plan.height - 1}"],
        "datapath": [
            _both(plan.datapath for plan in plans),
            f"u {_both(p.coordinate_formats[0] for p in paths)}",
            f"v {_both(p.coordinate_formats[1] for p in paths)}",
            f"{_both(p.cost.lut for p in paths)} LUT, estimated",
            f"latency {_both(p.latency for p in paths)} clocks",
        ],
    }


def _both(values):
    return " | ".join(dict.fromkeys(str(value) for value in values))


def _wide(texts):
    places = {
        "capture": (70, 30, 150, 84),
        "line buffer": (360, 20, 230, 104),
        "bilinear": (700, 30, 165, 84),
        "row flow": (70, 200, 150, 64),
        "raster": (320, 190, 110, 84),
        "datapath": (520, 172, 230, 128),
    }
    arrows = [
        Arrow("M14 72H66", "s_axis", 38, 62),
        Arrow("M220 72H356", "pixels", 288, 62),
        Arrow("M590 72H696", "2x2 window", 643, 62),
        Arrow("M865 72H946", "m_axis", 902, 62),
        Arrow("M145 114V196", "row complete", 153, 160, "start"),
        Arrow("M220 232H316", "row may start", 268, 222),
        Arrow("M430 232H516", "x, y", 472, 222),
        Arrow("M560 172V128", "u, v", 568, 155, "start"),
    ]
    return Diagram("wide", 960, 310, [Box(*places[name], name, lines) for name, lines in texts.items()], arrows)


def _narrow(texts):
    places = {
        "capture": (6, 46, 158, 84),
        "line buffer": (6, 236, 212, 104),
        "bilinear": (6, 420, 158, 84),
        "row flow": (222, 56, 152, 64),
        "raster": (222, 166, 152, 84),
        "datapath": (176, 372, 198, 128),
    }
    arrows = [
        Arrow("M85 8V42", "s_axis", 93, 28, "start"),
        Arrow("M85 130V232", "pixels", 93, 186, "start"),
        Arrow("M85 340V416", "2x2", 77, 376, "end"),
        Arrow("M85 504V546", "m_axis", 93, 530, "start"),
        Arrow("M164 88H218", "row", 191, 78),
        Arrow("M310 120V162", "start", 302, 146, "end"),
        Arrow("M330 250V368", "x, y", 338, 312, "start"),
        Arrow("M198 372V344", "u, v", 206, 364, "start"),
    ]
    return Diagram("narrow", 380, 552, [Box(*places[name], name, lines) for name, lines in texts.items()], arrows)
