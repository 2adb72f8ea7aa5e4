"""A rectifier inside an Amaranth design of one's own: the rectified image in black and white.

python examples/black_and_white.py CALIBRATION > black_and_white.v
"""

import sys

from amaranth import Module, Mux
from amaranth.lib import wiring

from hdl import calibration
from hdl.core.build import Options, build
from hdl.geometry.rectification import rectify
from hdl.stream.rectifier import RectifierParameters, StreamRectifier
from hdl.tools.verilog import convert


class BlackAndWhite(wiring.Component):
    """Frames of 8 bits in, on ``i``; rectified, the pixels from ``level`` on white, the others black, out on ``o``."""

    def __init__(self, parameters: RectifierParameters, level: int = 128) -> None:
        self.rectifier, self.level = StreamRectifier(parameters), level
        super().__init__(self.rectifier.signature)

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.rectifier = rectifier = self.rectifier
        wiring.connect(m, wiring.flipped(self.i), rectifier.i)
        m.d.comb += [
            self.o.valid.eq(rectifier.o.valid),
            rectifier.o.ready.eq(self.o.ready),
            self.o.payload.eq(rectifier.o.payload),
            self.o.p.pixel.eq(Mux(rectifier.o.p.pixel >= self.level, 255, 0)),
        ]
        return m


def main() -> None:
    rig = calibration.load(sys.argv[1]) if len(sys.argv) > 1 else calibration.embedded()
    core = build(rectify(rig, lens=True)["left"], Options(max_error=0.05), "rectifier")
    print(convert(BlackAndWhite(core.parameters), "black_and_white", header=core.plan.datapath), end="")
    print(core.plan.error, file=sys.stderr)


if __name__ == "__main__":
    main()
