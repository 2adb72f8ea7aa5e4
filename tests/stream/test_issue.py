"""Rows of positions, each issued once its source rows are there."""

import random

import pytest
from amaranth import Module

from hdl.stream.issue import Issue
from hdl.stream.raster import NEAR, Raster
from sim.drivers import never, pauses, simulate

WIDTH, HEIGHT = 7, 3
KINDS = [(warm_up, ahead) for warm_up in (0, 4) for ahead in (False, True)]
kinds = pytest.mark.parametrize("warm_up, ahead", KINDS, ids=lambda value: str(value))


def behind_a_raster(warm_up, ahead):
    m = Module()
    m.submodules.raster = raster = Raster(WIDTH, HEIGHT, warm_up, ahead)
    m.submodules.issue = issue = Issue(warm_up > 0, ahead)
    m.d.comb += [
        raster.step.eq(issue.step),
        issue.end_of_line.eq(raster.end_of_line),
        issue.last_row.eq(raster.last_row),
        issue.near_end.eq(raster.near_end),
    ]
    return m, raster, issue


def run(warm_up, ahead, frames, stands, grants):
    """Issue ``frames`` frames; the pipeline stands in the clocks of ``stands``.

    ``grants`` says whether the source rows of one more row come in this clock. Returns the clocks of the steps, and
    (clock, positions that were issued by then, is it the frame's last) of the rows that counted as issued.
    """
    m, raster, issue = behind_a_raster(warm_up, ahead)
    size, rows = WIDTH * HEIGHT, frames * HEIGHT

    async def testbench(ctx):
        steps, counts = [], []
        granted = issued = clock = 0
        while issued < frames * size or len(counts) < rows:
            enable = not next(stands)
            ctx.set(issue.enable, enable)
            # As `RowFlow` says it: of the row after those that count as issued.
            ctx.set(issue.may_issue, granted > len(counts))
            _, _, step, is_issue, x, y, row, frame = await ctx.tick().sample(
                issue.step, issue.issue, raster.x, raster.y, issue.row_issued, issue.frame_issued
            )
            if step:
                assert enable
                assert (y * WIDTH + x - len(steps) + warm_up) % size == 0
                steps.append(clock)
            assert is_issue == (step and len(steps) > warm_up)
            if is_issue:
                assert issued // WIDTH < granted, "a row whose source rows are missing"
                issued += 1
            assert row or not frame
            if row:
                counts.append((clock, issued, bool(frame)))
            granted += granted < rows and not next(grants)
            clock += 1
        return steps, counts

    ((steps, counts),) = simulate(m, testbench, clocks=20 * frames * size + 100)
    return steps, counts


@kinds
@pytest.mark.parametrize(
    "standing, waiting, burst", [(0.5, 0.0, 1), (0.0, 0.9, 20), (0.3, 0.85, 5), (0.6, 0.9, 15)], ids=str
)
def test_every_position_is_issued_once_its_row_may_be(warm_up, ahead, standing, waiting, burst):
    steps, counts = run(warm_up, ahead, 5, pauses(standing, 1, burst), pauses(waiting, 2, burst))
    assert len(steps) >= warm_up + 5 * WIDTH * HEIGHT
    assert [last for *_, last in counts] == ([False] * (HEIGHT - 1) + [True]) * 5
    for row, (_, issued, _) in enumerate(counts):
        # Ahead, it is one of the clocks after the position near the end: of the few that are left, one may be issued.
        near = (row + 1) * WIDTH - NEAR * ahead
        assert near <= issued <= near + ahead


@kinds
def test_positions_follow_each_other_in_every_clock_where_no_row_waits(warm_up, ahead):
    steps, _ = run(warm_up, ahead, 3, never(), never())
    assert steps[warm_up:] == list(range(steps[warm_up], steps[warm_up] + len(steps) - warm_up))
    # The first row's permission comes after a clock, and a clock later to a register.
    assert steps[0] == (0 if warm_up else 1 + ahead)


@pytest.mark.parametrize("warm_up", [0, 4])
def test_ahead_nothing_but_the_enable_acts_within_the_clock(warm_up):
    issue = Issue(warm_up > 0, ahead=True)
    generator = random.Random(warm_up)
    flags = issue.may_issue, issue.end_of_line, issue.last_row, issue.near_end

    async def testbench(ctx):
        seen = set()
        for _ in range(100):
            ctx.set(issue.enable, generator.getrandbits(1))
            outputs = issue.step, issue.issue, issue.row_issued, issue.frame_issued
            found = set()
            for _ in range(8):
                for flag in flags:
                    ctx.set(flag, generator.random() < 0.8)
                found.add(tuple(map(ctx.get, outputs)))
            assert len(found) == 1
            seen |= found
            await ctx.tick()
        return seen

    (seen,) = simulate(issue, testbench, clocks=200)
    assert all(any(values) for values in zip(*seen))
