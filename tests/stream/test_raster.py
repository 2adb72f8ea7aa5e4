import pytest

from hdl.stream.raster import NEAR, Raster
from sim.drivers import pauses, simulate

ahead = pytest.mark.parametrize("ahead", [False, True], ids=["at once", "ahead"])


def outputs(raster):
    return (
        raster.x,
        raster.y,
        raster.start_of_frame,
        raster.end_of_line,
        raster.last_row,
        raster.near_end,
    )


def position(x, y, width, height):
    """What `outputs` are at a position."""
    return x, y, (x, y) == (0, 0), x == width - 1, y == height - 1, x == width - 1 - NEAR


@ahead
@pytest.mark.parametrize("width, height", [(5, 4), (8, 8), (16, 3), (33, 2), (7, 9), (4, 1)])
@pytest.mark.parametrize("share", [0.0, 0.5], ids=["every clock", "with gaps"])
def test_positions_and_flags_of_three_frames(width, height, share, ahead):
    raster = Raster(width, height, ahead=ahead)
    gaps = pauses(share, seed=width)
    expected = [position(x, y, width, height) for _ in range(3) for y in range(height) for x in range(width)]

    async def testbench(ctx):
        for wanted in [*expected, *expected[:3]]:
            paused = True
            while paused:
                paused = next(gaps)
                ctx.set(raster.step, not paused)
                # It stands while there is no step.
                _, _, *values = await ctx.tick().sample(*outputs(raster))
                assert tuple(values) == wanted
        return True

    assert simulate(raster, testbench, clocks=10 * len(expected)) == [True]


@ahead
@pytest.mark.parametrize("warm_up", [1, 3, 4, 6])
def test_warm_up_begins_with_the_last_positions_of_a_frame(warm_up, ahead):
    width, height = 7, 5
    raster = Raster(width, height, warm_up, ahead)
    places = [
        *((x, height - 1) for x in range(width - warm_up, width)),
        *((x, y) for y in range(2) for x in range(width)),
    ]

    async def testbench(ctx):
        ctx.set(raster.step, 1)
        return [tuple((await ctx.tick().sample(*outputs(raster)))[2:]) for _ in places]

    (positions,) = simulate(raster, testbench, clocks=40)
    assert positions == [position(x, y, width, height) for x, y in places]


@pytest.mark.parametrize("width", [1, 2, NEAR])
def test_rows_too_short_to_look_ahead(width):
    raster = Raster(width, 3)

    async def testbench(ctx):
        ctx.set(raster.step, 1)
        return [tuple((await ctx.tick().sample(*outputs(raster)))[2:]) for _ in range(7 * width)]

    (positions,) = simulate(raster, testbench, clocks=40)
    assert positions == [position(x, y % 3, width, 3) for y in range(7) for x in range(width)]
