"""The proofs by what is put into them; for designs without a fault, and for those that have one."""

import numpy as np

from hdl.arithmetic.cuts import BALANCED, COMPACT, FAST
from hdl.arithmetic.differences import DifferenceForm
from hdl.arithmetic.linear import LinearForm
from hdl.stream.bilinear import Bilinear
from hdl.stream.ports import InputRegister, OutputSkid

from .arithmetic import AccumulatorProof, DifferenceProof, DividerProof
from .capture import CaptureProof
from .core import any_core
from .interpolation import BilinearProof, PauseProof
from .ports import BITS, PortProof
from .streams import FramesProof, StabilityProof, WaitsProof, ZeroStallProof
from .window import WindowProof, tag_bits

# px; about the shortest rows that there are for a pipeline.
WIDTHS = {COMPACT: 3, BALANCED: 6, FAST: 8}


def tagged_core(width, height, d_lo, d_hi, **options):
    return any_core(width, height, d_lo, d_hi, tag_bits=tag_bits(width, height), **options)


# Of cores that are as small as may be, without lemmas: for a search from the reset on.


def stability(pipeline=COMPACT):
    return StabilityProof(any_core(WIDTHS[pipeline] + 1, 4, 0, 1, pipeline=pipeline))


def zero_stall(pipeline=COMPACT):
    return ZeroStallProof(any_core(WIDTHS[pipeline], 3, 0, 1, pipeline=pipeline), lemmas=False)


def waits(pipeline=COMPACT):
    return WaitsProof(any_core(WIDTHS[pipeline], 3, 0, 1, pipeline=pipeline), lemmas=False)


def frames(pipeline=COMPACT):
    return FramesProof(any_core(WIDTHS[pipeline], 3, 0, 1, pipeline=pipeline), lemmas=False)


def capture(ahead=False):
    return CaptureProof(3, 2, ahead, lemmas=False)


def windows(*window, steady=True, **options):
    return lambda: WindowProof(tagged_core(*window, reach=1, **options), steady=steady)


def accumulator(*form):
    return lambda: AccumulatorProof(LinearForm(*form), lemmas=False)


def difference(*form):
    return lambda: DifferenceProof(DifferenceForm(np.array(form[0]), *form[1:]), lemmas=False)


def divider():
    return DividerProof([(5, 1), (4, 0)], divisor_bits=4, quotient_bits=5, lemmas=False)


def bilinear(pipeline=COMPACT, fraction_bits=2):
    return lambda: BilinearProof(2, 1, fraction_bits, 1, pipeline)


def pauses(pipeline=COMPACT):
    return lambda: PauseProof(Bilinear(2, 1, 2, 1, pipeline))


def input_register():
    return PortProof(InputRegister(BITS), lemmas=False)


def output_skid():
    return PortProof(OutputSkid(BITS), lemmas=False)
