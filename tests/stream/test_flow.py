import random

import pytest

from hdl.stream.flow import RowFlow
from sim.drivers import simulate


class Counted:
    """The docstring's rules on plain counters of rows, frames counted through."""

    def __init__(self, lead, height):
        self.lead, self.height = lead, height
        self.written = self.issued = 0

    @property
    def may_write(self):
        return self.written <= self.issued + self.lead + 1

    @property
    def may_issue(self):
        frame, row = divmod(self.issued, self.height)
        return self.written > frame * self.height + row + self.lead or self.written >= (frame + 1) * self.height


def run(lead, height, ahead, rows, wants):
    """Move ``rows`` rows through both sides.

    ``wants()`` says which side, (write, issue), would like to complete a row in this clock. Each does so only where the
    block allows it, and what it allows is compared with `Counted` in every clock. Returns (rows ahead, may_write,
    may_issue) of each clock.
    """
    flow = RowFlow(lead, ahead)
    model = Counted(lead, height)

    async def testbench(ctx):
        seen = []
        while model.issued < rows:
            allowed = bool(ctx.get(flow.may_write)), bool(ctx.get(flow.may_issue))
            assert allowed == (model.may_write, model.may_issue), vars(model)
            seen.append((model.written - model.issued, *allowed))
            write, issue = (want and may for want, may in zip(wants(), allowed))
            ctx.set(flow.row_written, write)
            ctx.set(flow.frame_written, write and model.written % height == height - 1)
            ctx.set(flow.row_issued, issue)
            ctx.set(flow.frame_issued, issue and model.issued % height == height - 1)
            await ctx.tick()
            model.written += write
            model.issued += issue
        return seen

    (seen,) = simulate(flow, testbench, clocks=60 * rows + 100)
    return seen


ahead = pytest.mark.parametrize("ahead", [False, True], ids=["compared", "by its sign"])


@ahead
@pytest.mark.parametrize("height, lead", [(8, 0), (8, 3), (8, 6), (2, 0), (5, 1), (24, 17)])
@pytest.mark.parametrize("write_share, issue_share", [(0.9, 0.1), (0.1, 0.9), (0.5, 0.5), (1.0, 1.0), (0.9, 0.9)])
def test_rules_hold_in_every_clock(height, lead, write_share, issue_share, ahead):
    generator = random.Random(height * 100 + lead)
    seen = run(
        lead, height, ahead, 12 * height, lambda: (generator.random() < write_share, generator.random() < issue_share)
    )
    if write_share > issue_share:
        assert max(rows for rows, _, _ in seen) == lead + 2


@ahead
@pytest.mark.parametrize("height, lead", [(9, 3), (9, 0), (9, 7)])
def test_a_row_may_go_in_in_every_clock_while_none_waits_to_go_out(height, lead, ahead):
    seen = run(lead, height, ahead, 10 * height, lambda: (True, True))
    assert all(may_write for _, may_write, _ in seen)
    assert [may_issue for *_, may_issue in seen] == [False] * (lead + 1) + [True] * (10 * height)


@ahead
def test_a_complete_frame_is_issued_without_another_row(ahead):
    lead, height = 4, 6
    flow = RowFlow(lead, ahead)

    async def testbench(ctx):
        for row in range(height):
            ctx.set(flow.row_written, 1)
            ctx.set(flow.frame_written, row == height - 1)
            assert ctx.get(flow.may_write)
            await ctx.tick()
        ctx.set(flow.row_written, 0)
        ctx.set(flow.frame_written, 0)
        for row in range(height):
            assert ctx.get(flow.may_issue), row
            ctx.set(flow.row_issued, 1)
            ctx.set(flow.frame_issued, row == height - 1)
            await ctx.tick()
        ctx.set(flow.row_issued, 0)
        ctx.set(flow.frame_issued, 0)
        assert not ctx.get(flow.may_issue)
        assert ctx.get(flow.may_write)

    simulate(flow, testbench, clocks=4 * height)


@ahead
def test_permissions_depend_on_registers_only(ahead):
    lead = 2
    flow = RowFlow(lead, ahead)

    async def testbench(ctx):
        for _ in range(lead + 3):  # from empty to full
            before = ctx.get(flow.may_write), ctx.get(flow.may_issue)
            for events in range(16):
                for bit, port in enumerate((flow.row_written, flow.frame_written, flow.row_issued, flow.frame_issued)):
                    ctx.set(port, events >> bit & 1)
                assert (ctx.get(flow.may_write), ctx.get(flow.may_issue)) == before
            for port in (flow.frame_written, flow.row_issued, flow.frame_issued):
                ctx.set(port, 0)
            await ctx.tick()

    simulate(flow, testbench, clocks=10)
