"""The cores, and the report of them, that the tests of the report share."""

import pytest
from report_pages import measured, write_cores

from hdl.core.build import Options
from hdl.report.page import page
from hdl.tools.synthesis import Resources
from hdl.tools.xc7_timing import Path

BUDGET = Options(max_error=0.1)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    return write_cores(tmp_path_factory.mktemp("cores"), BUDGET)


def synthesised(verilog, top, **_):
    """In place of synthesis: figures that tell the texts apart; left faster than right."""
    resources = Resources(ff=301, lut=70000 + len(verilog), srl=0, lut_ram=0, carry4=31, dsp=0, ramb18=3, ramb36=1)
    return resources, Path(8.0 if top.endswith("left") else 12.5, "line_buffer", "bilinear", "D", ())


@pytest.fixture(scope="module")
def report(written):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hdl.report.measure.synthesised", synthesised)
        return measured(written, synthesis=True)


@pytest.fixture(scope="module")
def html(report):
    return page(report)
