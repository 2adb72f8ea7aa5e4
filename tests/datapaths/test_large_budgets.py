"""Budgets beyond everything that matters: each datapath has words for them."""

import pytest

from hdl import calibration
from hdl.datapaths import DATAPATHS
from hdl.datapaths.base import COARSEST
from hdl.geometry.rectification import rectify


@pytest.mark.filterwarnings("error")  # such as of a division by 0
@pytest.mark.parametrize("budget", [100.0, 1e9, 1e300])
@pytest.mark.parametrize(
    "name, lens", [(name, lens) for name in DATAPATHS for lens in (False, True)[: 1 + DATAPATHS[name].supports_lens]]
)
def test_any_budget_has_its_word_lengths(name, lens, budget):
    view = rectify(calibration.embedded((64, 48)), lens=lens)["left"]
    error = DATAPATHS[name].fit(view, 5, budget).coordinates.error(*view.map(), view.source_size)
    worst = max(error["u"]["max"], error["v"]["max"])
    assert worst <= (COARSEST if name in ("conventional", "accumulate") else budget)
