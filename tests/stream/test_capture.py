import random

import pytest

from hdl.stream.capture import Capture
from sim.drivers import Stream, never, pauses, send, simulate


def frame(width, height, lines=None):
    """Beats (sof, eol) of a frame; ``lines`` are the lengths of its lines where they are not all ``width``."""
    lengths = [width] * height if lines is None else lines
    return [(int((x, y) == (0, 0)), int(x == length - 1)) for y, length in enumerate(lengths) for x in range(length)]


def contract(beats, width, height):
    """What the docstring promises for ``beats``: events ("pixel", x, beat) and ("row", is it the frame's last)."""
    events, row, x = [], None, 0
    for index, (sof, eol) in enumerate(beats):
        if sof and row is not None:
            events += [("row", missing == height - 1) for missing in range(row, height)]
            row = None
        if sof:
            row, x = 0, 0
        if row is None:
            continue
        if x < width:
            events.append(("pixel", x, index))
        x += 1
        if eol:
            events.append(("row", row == height - 1))
            row, x = (None if row == height - 1 else row + 1), 0
    return events


def capture(beats, width, height, ahead, idle, may_write_pauses):
    """The events of the block, as `contract` has them."""
    block = Capture(width, height, ahead)
    stream = Stream(block.valid, block.ready, (block.sof, block.eol))
    expected = len(contract(beats, width, height))

    async def watch(ctx):
        events, taken, settle = [], 0, 20
        while settle:
            ctx.set(block.may_write, not next(may_write_pauses))
            _, _, may_write, valid, ready, write, x, row_written, frame_written = await ctx.tick().sample(
                block.may_write, block.valid, block.ready, block.write, block.x, block.row_written, block.frame_written
            )
            assert may_write or not (ready or row_written), "a row was touched that may not be written"
            assert not write or (valid and ready), "a pixel was written without a beat"
            assert not frame_written or row_written, "a frame ended within a row"
            if write:
                events.append(("pixel", x, taken))
            if row_written:
                events.append(("row", bool(frame_written)))
            taken += valid and ready
            settle -= taken == len(beats) and len(events) >= expected
        return events

    clocks = 20 * (len(beats) + expected) + 200
    _, events = simulate(block, send(stream, beats, idle), watch, clocks=clocks)
    return events


W, H = 6, 4
GOOD = frame(W, H)
BROKEN = {
    "a line too short": frame(W, H, [W, W - 2, W, W]),
    "lines of one pixel": frame(W, H, [1, 1, 1, 1]),
    "the first line too short": frame(W, H, [1, W, W, W]),
    "the last line too short": frame(W, H, [W, W, W, 3]),
    "a line too long": frame(W, H, [W, W + 1, W, W]),
    "a line far too long": frame(W, H, [W, W, 5 * W, W]),
    "a frame too short": frame(W, H, [W, W]),
    "a frame of one pixel": [(1, 0)],
    "a frame cut within a line": frame(W, H)[: W + 3],
    "a frame cut before its last pixel": frame(W, H)[:-1],
    "a frame too long": frame(W, H, [W] * (H + 1)),
    "a frame far too long": frame(W, H, [W] * (3 * H)),
    "the end of a line missing": [(sof, eol and index != 2 * W - 1) for index, (sof, eol) in enumerate(frame(W, H))],
    "the end of the last line missing": frame(W, H)[:-1] + [(0, 0)],
    "every end of line missing": [(sof, 0) for sof, _ in frame(W, H)],
    "a start of frame in mid frame": frame(W, H)[: 2 * W] + frame(W, H),
    "starts of frames one after the other": [(1, 0), (1, 1), (1, 0)],
    "a start of frame that ends its line": [(1, 1)] + frame(W, H)[1:],
    "beats before the start of frame": [(0, 0), (0, 1), (0, 1), (0, 0)] + frame(W, H),
    "a line before the start of frame": frame(W, 1)[1:] + frame(W, H),
}


ahead = pytest.mark.parametrize("ahead", [False, True], ids=["at once", "ahead"])


@ahead
@pytest.mark.parametrize("share", [0.0, 0.5], ids=["no waiting", "waiting"])
def test_good_frames_are_numbered_through(share, ahead):
    beats = GOOD * 3
    events = capture(beats, W, H, ahead, pauses(share, 1), pauses(share, 2))
    expected, index = [], 0
    for _ in range(3):
        for y in range(H):
            for x in range(W):
                expected.append(("pixel", x, index))
                index += 1
            expected.append(("row", y == H - 1))
    assert events == expected


@ahead
@pytest.mark.parametrize("share", [0.0, 0.4], ids=["no waiting", "waiting"])
@pytest.mark.parametrize("name", BROKEN)
def test_next_frame_is_in_step_after(name, share, ahead):
    beats = GOOD + BROKEN[name] + GOOD + GOOD
    events = capture(beats, W, H, ahead, pauses(share, 3), pauses(share, 4))
    assert events == contract(beats, W, H)
    # Every frame that was started has all its rows, and the last two are whole.
    rows = [last for kind, last, *_ in events if kind == "row"]
    assert rows == [False, False, False, True] * sum(sof for sof, _ in beats)
    assert events[-2 * (W * H + H) :] == [
        (kind, at, *(index + len(beats) - 2 * W * H for index in beat)) for kind, at, *beat in contract(GOOD * 2, W, H)
    ]


@ahead
def test_a_frame_that_breaks_off_is_completed_before_the_next_start_of_frame_is_taken(ahead):
    beats = GOOD[: W + 3] + GOOD
    events = capture(beats, W, H, ahead, never(), never())
    first = next(index for index, event in enumerate(events) if event == ("pixel", 0, W + 3))
    assert events[first - 3 : first] == [("row", False), ("row", False), ("row", True)]


@ahead
@pytest.mark.parametrize("width, height, seed", [(6, 4, 1), (5, 1, 2), (8, 3, 3), (7, 2, 4), (1, 5, 5)])
def test_any_stream_is_taken_to_its_end(width, height, seed, ahead):
    generator = random.Random(seed)
    beats = [(int(generator.random() < 0.04), int(generator.random() < 1.2 / width)) for _ in range(500)]
    beats += frame(width, height)
    assert capture(beats, width, height, ahead, pauses(0.3, seed), pauses(0.3, seed + 1, burst=4)) == (
        contract(beats, width, height)
    )
