"""Video formats, and the margins by which a clock meets theirs."""

import pytest

from hdl.report.video import FORMATS, margins


def test_pixel_clocks_leave_room_for_the_blanking_and_no_more_than_formats_have():
    for format in FORMATS:
        pixels = format.width * format.height * format.hz / 1e6
        assert pixels < format.mhz < 1.4 * pixels


def test_formats_come_from_slow_to_fast():
    clocks = [format.mhz for format in FORMATS]
    assert clocks == sorted(clocks)


def test_a_margin_is_how_much_faster_the_core_is_than_the_format():
    found = margins(111.375)
    assert [margin.format for margin in found] == list(FORMATS)
    by_clock = {margin.format.mhz: margin for margin in found}
    assert by_clock[74.25].share == pytest.approx(0.5) and by_clock[74.25].met
    assert by_clock[148.5].share == pytest.approx(-0.25) and not by_clock[148.5].met


def test_a_clock_that_is_just_the_formats_meets_it():
    assert all(margin.met and margin.share == 0 for margin in margins(74.25) if margin.format.mhz == 74.25)


@pytest.mark.parametrize("mhz", [0.0, -1.0, float("nan")])
def test_no_clock_is_refused(mhz):
    with pytest.raises(ValueError, match=f"^mhz = {mhz}: must be positive$"):
        margins(mhz)
