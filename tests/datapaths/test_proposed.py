import numpy as np
import pytest
import rigs

from hdl.arithmetic.linear import LinearForm
from hdl.datapaths.base import default_budget
from hdl.datapaths.proposed import Proposed


@pytest.mark.parametrize("side", rigs.SIDES)
@pytest.mark.parametrize("rig", rigs.NAMES)
def test_accumulators_of_eq_6_have_the_fewest_bits(rig, side):
    view = rigs.view(rig, side, 320, 240)
    proposed = Proposed.fit(view, 5)
    x, y = np.meshgrid(np.arange(320), np.arange(240))
    for form, row in ((proposed.u_form, rigs.matrix(view)[0]), (proposed.v_form, rigs.matrix(view)[1])):
        for bits in range(5, form.fraction_bits + 1):
            candidate = LinearForm.quantise(row, bits, 320, 240, half=1 / 64)
            error = np.abs((candidate.values(x, y) >> (bits - 5)) / 32 - (row[0] * x + row[1] * y + row[2])).max()
            assert (error <= default_budget(5)) == (bits == form.fraction_bits)


@pytest.mark.parametrize("rig", rigs.NAMES)
def test_no_accumulator_overflows(rig):
    for side in rigs.SIDES:
        datapath = Proposed.fit(rigs.view(rig, side, 160, 120), 5)
        x, y = np.arange(160), np.arange(120)[:, None]
        for axis, form in (("u", datapath.u_form), ("v", datapath.v_form)):
            assert datapath.formats[axis] == form.format
            assert rigs.fits(form.format, form.values(x, y))
