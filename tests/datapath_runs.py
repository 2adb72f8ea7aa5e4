"""A datapath's hardware by itself, in Amaranth's simulator, against its integer model."""

from collections import deque

import numpy as np

from sim.drivers import simulate


def run(datapath, frames, stands, idle):
    """(u, v) for each position of ``frames`` frames, after those of the warm-up.

    The pipeline stands in the clocks of ``stands``; of the others, no position is taken in those of ``idle``. Each
    coordinate is looked for exactly `latency` enabled clocks after its position was taken. While nothing is taken,
    position and flags stay, as behind `hdl.stream.raster`.
    """
    block = datapath.component()
    size = datapath.width * datapath.height

    async def testbench(ctx):
        results = []
        index = -datapath.warm_up
        reading = deque([False] * datapath.latency)
        while len(results) < frames * size:
            y, x = divmod(index % size, datapath.width)
            enable = not next(stands)
            step = enable and index < frames * size and not next(idle)
            ctx.set(block.enable, enable)
            ctx.set(block.step, step)
            ctx.set(block.x, x)
            ctx.set(block.y, y)
            ctx.set(block.end_of_line, x == datapath.width - 1)
            ctx.set(block.end_of_frame, index % size == size - 1)
            _, _, u, v = await ctx.tick().sample(block.u, block.v)
            if enable:
                reading.append(step and index >= 0)
                if reading.popleft():
                    results.append((u, v))
            index += step
        return results

    (results,) = simulate(block, testbench, clocks=6 * frames * size + 500)
    return np.array(results).reshape(frames, datapath.height, datapath.width, 2)


def assert_same(results, datapath):
    for frame in results:
        np.testing.assert_array_equal(frame[..., 0], datapath.coordinates.u)
        np.testing.assert_array_equal(frame[..., 1], datapath.coordinates.v)
