"""Blocks name the parameter that they cannot be built with."""

import gc
import warnings

import pytest
from amaranth.hdl import UnusedElaboratable

from hdl.arithmetic.divider import Divider
from hdl.stream.bilinear import Bilinear
from hdl.stream.capture import Capture
from hdl.stream.flow import RowFlow
from hdl.stream.raster import Raster


@pytest.mark.parametrize(
    "build, message",
    [
        (lambda: Raster(0, 4), "width = 0: at least 1 is needed"),
        (lambda: Raster(4, -1), "height = -1: at least 1 is needed"),
        (lambda: Raster(4, 4, -1), "warm_up = -1: at least 0 is needed"),
        (lambda: Raster(4, 4, 4), "warm_up = 4: less than the width, 4, is needed"),
        (lambda: Raster(3, 4, ahead=True), "width = 3: at least 4 is needed"),
        (lambda: Capture(0, 4), "width = 0: at least 1 is needed"),
        (lambda: Capture(4, 0), "height = 0: at least 1 is needed"),
        (lambda: RowFlow(-1), "lead = -1: at least 0 is needed"),
        (lambda: Bilinear(0, 1, 5), "pixel_bits = 0: at least 1 is needed"),
        (lambda: Bilinear(8, 0, 5), "channels = 0: at least 1 is needed"),
        (lambda: Bilinear(8, 1, 0), "fraction_bits = 0: at least 1 is needed"),
        (lambda: Bilinear(8, 1, 5, -1), "lead = -1: at least 0 is needed"),
        (lambda: Divider([], divisor_bits=4, quotient_bits=4), "dividends = 0: at least 1 is needed"),
        (lambda: Divider([(0, 0)], divisor_bits=4, quotient_bits=4), "dividend_bits = 0: at least 1 is needed"),
        (lambda: Divider([(4, -1)], divisor_bits=4, quotient_bits=4), "shift = -1: at least 0 is needed"),
        (lambda: Divider([(4, 0)], divisor_bits=0, quotient_bits=4), "divisor_bits = 0: at least 1 is needed"),
        (lambda: Divider([(4, 0)], divisor_bits=4, quotient_bits=0), "quotient_bits = 0: at least 1 is needed"),
    ],
)
def test_parameters_out_of_range_are_refused_by_name(build, message):
    found = None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnusedElaboratable)
        try:
            build()
        except ValueError as error:
            found = str(error)
        gc.collect()  # of what is half built, while nobody is warned of it
    assert found == message
