"""Input that is no whole frames: what comes out is, and is exact again with the next whole frame."""

import numpy as np
import pytest
import rigs
from cores import HEIGHT, WIDTH, frames_of, parameters, random_frames, random_map, rectified, run, stream_of

from hdl.arithmetic.cuts import BALANCED, COMPACT, FAST, PIPELINES
from hdl.stream.rectifier import RectifierParameters
from sim.drivers import never, pauses

# From the lines of a whole frame, each a list of beats, those of a broken one.
BROKEN = {
    "a line too short": lambda lines: lines[:5] + [lines[5][:3] + lines[5][-1:]] + lines[6:],
    "lines of one pixel": lambda lines: [[(*line[0][:2], 1)] for line in lines],
    "every line too short": lambda lines: [line[:-5] + line[-1:] for line in lines],
    "a line too long": lambda lines: lines[:5] + [lines[5][:9] * 4 + lines[5][-1:]] + lines[6:],
    "an end of line missing": lambda lines: lines[:5] + [lines[5][:-1]] + lines[6:],
    "every end of line missing": lambda lines: [line[:-1] for line in lines],
    "too few lines": lambda lines: lines[: HEIGHT // 2],
    "too many lines": lambda lines: lines + lines[1:],
    "no start of frame": lambda lines: lines[1:],
    "cut within a line": lambda lines: lines[:7] + [lines[7][:5]],
    "cut before its last pixel": lambda lines: lines[:-1] + [lines[-1][:-1]],
    "started twice": lambda lines: lines[:3] + lines,
}


@pytest.mark.parametrize(
    "name, defect, pipeline",
    [
        *(("proposed", defect, BALANCED) for defect in BROKEN),
        ("conventional", "too few lines", FAST),
        ("spline", "lines of one pixel", FAST),
        ("accumulate", "a line too long", COMPACT),
        ("spline", "too few lines", COMPACT),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_frames_after_a_broken_one_are_exact(name, defect, pipeline):
    p = parameters(name, rigs.view("rolled", "left", WIDTH, HEIGHT), pipeline=pipeline)
    frames = random_frames(p, 4)
    streams = [stream_of(p, [frame]) for frame in frames]
    lines = [streams[1][y * WIDTH : (y + 1) * WIDTH] for y in range(HEIGHT)]
    streams[1] = [beat for line in BROKEN[defect](lines) for beat in line]
    beats = [beat for stream in streams for beat in stream]
    started = sum(user for _, user, _ in beats)
    sent, received = run(p, beats, started, pauses(0.2, 1), pauses(0.1, 2))
    assert len(sent) == len(beats)
    out = frames_of(p, received)
    assert len(out) == started
    for position, index in ((0, 0), (-2, 2), (-1, 3)):
        np.testing.assert_array_equal(out[position], rectified(p, frames[index]))


@pytest.mark.parametrize("pipeline", PIPELINES.values(), ids=PIPELINES)
def test_lines_too_long_spoil_no_row_that_is_still_needed(pipeline):
    # Rows follow each other in the memories without a gap, and no row is kept that the map does not need.
    p = RectifierParameters(random_map(16, 12, -2, 3, 8 - 5 * pipeline.ahead, pipeline))
    buffer = p.line_buffer
    assert (buffer.pitch * buffer.granule, buffer.rows) == (8, 5 + 3)
    frames = random_frames(p, 4)
    streams = [stream_of(p, [frame]) for frame in frames]
    streams[1] = [beat for y in range(12) for beat in streams[1][16 * y : 16 * y + 15] + [(0, 0, 0)] * 40 + [(0, 0, 1)]]
    sent, received = run(p, [beat for stream in streams for beat in stream], 4, never(), pauses(0.8, 1, burst=100))
    out = frames_of(p, received)
    assert len(out) == 4
    for index in (0, 2, 3):
        np.testing.assert_array_equal(out[index], rectified(p, frames[index]))
