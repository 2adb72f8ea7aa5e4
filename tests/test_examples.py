"""The examples do what they say."""

import runpy
import sys
from pathlib import Path

import cores
import linters
import numpy as np

from hdl import calibration
from sim.drivers import Stream, pauses, receive, send, simulate

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def stream(port):
    return Stream(port.valid, port.ready, (port.p.pixel, port.p.start_of_frame, port.p.end_of_line))


def test_black_and_white_is_the_rectified_image_with_a_threshold():
    p = cores.parameters("proposed")
    design = runpy.run_path(str(EXAMPLES / "black_and_white.py"))["BlackAndWhite"](p, level=100)
    (frame,) = frames = cores.random_frames(p, 1)
    beats = cores.stream_of(p, frames)
    sent, received = simulate(
        design,
        send(stream(design.i), beats, pauses(0.2, seed=1)),
        receive(stream(design.o), frame.size, pauses(0.2, seed=2)),
        clocks=10 * len(beats) + 1000,
    )
    (out,) = cores.frames_of(p, received)
    np.testing.assert_array_equal(out, np.where(cores.rectified(p, frame) >= 100, 255, 0))


def test_black_and_white_is_written_as_verilog(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["black_and_white.py"])
    monkeypatch.setattr(calibration, "embedded", lambda size=(160, 120), embedded=calibration.embedded: embedded(size))
    runpy.run_path(str(EXAMPLES / "black_and_white.py"), run_name="__main__")
    (tmp_path / "black_and_white.v").write_text(capsys.readouterr().out)
    for verilator in linters.VERILATORS.values():
        assert linters.warnings([*verilator, "black_and_white.v"], tmp_path) == []
