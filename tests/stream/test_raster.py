import pytest

from hdl.stream.raster import Raster
from sim.drivers import pauses, simulate


@pytest.mark.parametrize("width, height", [(5, 4), (8, 8), (16, 3), (33, 2), (7, 9)])
@pytest.mark.parametrize("share", [0.0, 0.5], ids=["every clock", "with gaps"])
def test_positions_and_flags_of_three_frames(width, height, share):
    raster = Raster(width, height)
    gaps = pauses(share, seed=width)
    expected = [
        (x, y, (x, y) == (0, 0), x == width - 1, (x, y) == (width - 1, height - 1))
        for _ in range(3)
        for y in range(height)
        for x in range(width)
    ]

    async def testbench(ctx):
        for position in [*expected, *expected[:3]]:
            paused = True
            while paused:
                paused = next(gaps)
                ctx.set(raster.step, not paused)
                # It stands while there is no step.
                _, _, x, y, *flags = await ctx.tick().sample(
                    raster.x, raster.y, raster.start_of_frame, raster.end_of_line, raster.end_of_frame
                )
                assert (x, y, *flags) == position
        return True

    assert simulate(raster, testbench, clocks=10 * len(expected)) == [True]


@pytest.mark.parametrize("warm_up", [1, 3, 6])
def test_warm_up_begins_with_the_last_positions_of_a_frame(warm_up):
    width, height = 7, 5
    raster = Raster(width, height, warm_up)
    expected = [
        *((x, height - 1, False, x == width - 1, x == width - 1) for x in range(width - warm_up, width)),
        (0, 0, True, False, False),
        (1, 0, False, False, False),
    ]

    async def testbench(ctx):
        ctx.set(raster.step, 1)
        return [
            tuple(
                (
                    await ctx.tick().sample(
                        raster.x, raster.y, raster.start_of_frame, raster.end_of_line, raster.end_of_frame
                    )
                )[2:]
            )
            for _ in expected
        ]

    (positions,) = simulate(raster, testbench, clocks=20)
    assert positions == expected
