"""The core: an AXI4-Stream of source frames in, an AXI4-Stream of rectified frames out."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from amaranth import Cat, ClockDomain, ClockSignal, Module, ResetSignal, Signal
from amaranth.lib import stream, wiring
from amaranth.lib.data import StructLayout
from amaranth.lib.wiring import In, Out

from hdl.datapaths.base import Datapath
from hdl.geometry.coordinates import Border
from hdl.stream.bilinear import Bilinear
from hdl.stream.capture import Capture
from hdl.stream.flow import RowFlow
from hdl.stream.linebuffer import LineBuffer, LineBufferParameters
from hdl.stream.raster import Raster

# (bits of a channel, channels)
PIXEL_FORMATS = ((8, 1), (10, 1), (12, 1), (16, 1), (8, 3))


@dataclass(frozen=True)
class RectifierParameters:
    """Everything that decides a core.

    Parameters
    ----------
    datapath : Datapath
    pixel_bits : int
        8, 10, 12 or 16 bits a channel.
    channels : int
        1, or 3 of 8 bits.
    border : Border

    Raises
    ------
    ValueError
        For pixel formats there are not, border values that do not fit, and rows that are too short for the pipeline;
        on access to ``line_buffer``, for frames too small for their map.
    """

    datapath: Datapath
    pixel_bits: int = 8
    channels: int = 1
    border: Border = Border()

    def __post_init__(self) -> None:
        if (self.pixel_bits, self.channels) not in PIXEL_FORMATS:
            formats = ", ".join(f"{channels}x{bits}" for bits, channels in PIXEL_FORMATS)
            raise ValueError(f"pixels are one of {formats} bits, not {self.channels}x{self.pixel_bits}")
        if not 0 <= self.border.value < 2**self.pixel_bits:
            raise ValueError(f"border value {self.border.value} does not fit into {self.pixel_bits} bits")
        if max(self.datapath.latency + LineBuffer.latency, self.datapath.warm_up) >= self.datapath.width:
            raise ValueError(f"a row of {self.datapath.width} px is shorter than the pipeline")

    @cached_property
    def line_buffer(self) -> LineBufferParameters:
        """The `LineBufferParameters`; its window is that of the integer model's taps, at every pixel."""
        datapath = self.datapath
        coordinates = datapath.coordinates
        u, v = datapath.coordinate_formats
        return LineBufferParameters(
            width=datapath.width,
            height=datapath.height,
            window=coordinates.window(self.border, (datapath.width, datapath.height)),
            u=u,
            v=v,
            u_range=coordinates.u_range,
            v_range=coordinates.v_range,
            border=self.border,
            channel_bits=self.pixel_bits,
            channels=self.channels,
        )

    @property
    def tdata_width(self) -> int:
        """Bits of tdata: the pixel, padded to whole bytes."""
        return -(-self.pixel_bits * self.channels // 8) * 8

    @property
    def pipeline_latency(self) -> int:
        """Clocks from the issue of a position to its pixel at m_axis."""
        return self.datapath.latency + LineBuffer.latency + Bilinear.latency

    @property
    def latency_cycles(self) -> int:
        """Clocks from the beat that brings a frame's first pixel to the beat that takes the first one away.

        With input without blanking and an output that is always ready.
        """
        return (self.line_buffer.window.lead + 1) * self.datapath.width + self.pipeline_latency


class Rectifier(wiring.Component):
    """A streaming rectifier: one pixel per clock, no frame buffer, no external memory.

    Source pixels go to the line buffer; once the rows are there that an output row needs, its positions are issued one
    a clock, turned into source coordinates by the datapath, into a 2x2 window by the line buffer and into a pixel by
    the interpolator. The whole read side moves on unless a pixel waits at ``m_axis``; the write side does not wait for
    it except through `RowFlow`. ``s_axis_tready`` does not depend on ``m_axis_tready`` within a clock.

    Throughput: 1 px/clock. For input in whole frames, with or without blanking, and an output that has taken every beat
    at once since the reset, ``s_axis_tready`` is never low. Whatever comes in and however the output pauses: counted
    from the reset, beats at ``s_axis`` wait for no more clocks than beats at ``m_axis`` waited and pixels, or the tlast
    at a frame's end, were missing from lines and frames that were too short. (Proved: `ZeroStallProof`, `WaitsProof`.)
    Latency: `RectifierParameters.latency_cycles`. A frame drains without further input. Lines and frames that are too
    short or too long: see `Capture`.

    Parameters
    ----------
    parameters : RectifierParameters

    Members
    -------
    aclk, aresetn : In(1)
        Clock; synchronous reset, active low.
    s_axis_tdata, s_axis_tvalid, s_axis_tready, s_axis_tuser, s_axis_tlast
        Source frames, one pixel a beat; tuser marks the start of a frame, tlast the end of a line.
    m_axis_tdata, m_axis_tvalid, m_axis_tready, m_axis_tuser, m_axis_tlast
        Rectified frames, likewise.

    Source: AMBA AXI4-Stream; AMD UG934 for video.
    """

    def __init__(self, parameters: RectifierParameters) -> None:
        self._parameters = parameters
        super().__init__(
            {
                "aclk": In(1),
                "aresetn": In(1),
                "s_axis_tdata": In(parameters.tdata_width),
                "s_axis_tvalid": In(1),
                "s_axis_tready": Out(1),
                "s_axis_tuser": In(1),
                "s_axis_tlast": In(1),
                "m_axis_tdata": Out(parameters.tdata_width),
                "m_axis_tvalid": Out(1),
                "m_axis_tready": In(1),
                "m_axis_tuser": Out(1),
                "m_axis_tlast": Out(1),
            }
        )

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        m.domains.sync = ClockDomain(local=True)
        m.d.comb += [ClockSignal().eq(self.aclk), ResetSignal().eq(~self.aresetn)]
        s_axis, m_axis = (
            _Pixels(*(getattr(self, f"{name}_{part}") for part in ("tvalid", "tready", "tdata", "tuser", "tlast")))
            for name in ("s_axis", "m_axis")
        )
        _connect(m, self._parameters, s_axis, m_axis)
        return m


class StreamRectifier(wiring.Component):
    """A `Rectifier` for one's own Amaranth design: in its domain ``sync``, with Amaranth's streams.

    Parameters
    ----------
    parameters : RectifierParameters

    Members
    -------
    i, o : In(stream), Out(stream)
        Source frames and rectified frames, one pixel a beat. Payload: ``pixel`` (the channels, the first in the low
        bits), ``start_of_frame``, ``end_of_line``.
    """

    i: Any
    o: Any

    def __init__(self, parameters: RectifierParameters) -> None:
        self._parameters = parameters
        pixels = stream.Signature(
            StructLayout({"pixel": parameters.pixel_bits * parameters.channels, "start_of_frame": 1, "end_of_line": 1})
        )
        super().__init__({"i": In(pixels), "o": Out(pixels)})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        s_axis, m_axis = (
            _Pixels(way.valid, way.ready, way.p.pixel, way.p.start_of_frame, way.p.end_of_line)
            for way in (self.i, self.o)
        )
        _connect(m, self._parameters, s_axis, m_axis)
        return m


@dataclass(frozen=True)
class _Pixels:
    """The signals of a stream of pixels, by their names in AXI4-Stream."""

    tvalid: Any
    tready: Any
    tdata: Any
    tuser: Any
    tlast: Any


def _connect(m: Module, p: RectifierParameters, s_axis: _Pixels, m_axis: _Pixels) -> None:
    """The blocks of a rectifier in ``m``, between the two streams."""
    width, height = p.datapath.width, p.datapath.height
    m.submodules.capture = capture = Capture(width, height)
    m.submodules.flow = flow = RowFlow(p.line_buffer.window.lead)
    m.submodules.raster = raster = Raster(width, height, p.datapath.warm_up)
    m.submodules.datapath = datapath = p.datapath.component()
    m.submodules.line_buffer = line_buffer = LineBuffer(p.line_buffer)
    m.submodules.bilinear = bilinear = Bilinear(p.pixel_bits, p.channels, p.datapath.fraction_bits)

    enable = Signal()
    warm = Signal(init=not p.datapath.warm_up)
    step = Signal()
    issue = Signal()
    if p.datapath.warm_up:
        with m.If(step & raster.end_of_frame):
            m.d.sync += warm.eq(1)
    m.d.comb += [
        enable.eq(~m_axis.tvalid | m_axis.tready),
        step.eq(enable & (flow.may_issue | ~warm)),
        issue.eq(step & warm),
        # s_axis to the line buffer
        capture.valid.eq(s_axis.tvalid),
        s_axis.tready.eq(capture.ready),
        capture.sof.eq(s_axis.tuser),
        capture.eol.eq(s_axis.tlast),
        capture.may_write.eq(flow.may_write),
        line_buffer.write.eq(capture.write),
        line_buffer.x.eq(capture.x),
        line_buffer.pixel.eq(s_axis.tdata),
        line_buffer.row_written.eq(capture.row_written),
        # rows in and rows out
        flow.row_written.eq(capture.row_written),
        flow.frame_written.eq(capture.frame_written),
        flow.row_issued.eq(issue & raster.end_of_line),
        flow.frame_issued.eq(issue & raster.end_of_frame),
        # raster positions to coordinates
        raster.step.eq(step),
        datapath.enable.eq(enable),
        datapath.step.eq(step),
        datapath.x.eq(raster.x),
        datapath.y.eq(raster.y),
        datapath.end_of_line.eq(raster.end_of_line),
        datapath.end_of_frame.eq(raster.end_of_frame),
        # coordinates to windows to pixels
        line_buffer.enable.eq(enable),
        line_buffer.u.eq(datapath.u),
        line_buffer.v.eq(datapath.v),
        bilinear.enable.eq(enable),
        bilinear.taps.eq(line_buffer.taps),
        bilinear.fx.eq(line_buffer.fx),
        bilinear.fy.eq(line_buffer.fy),
        bilinear.odd_column.eq(line_buffer.odd_column),
        bilinear.odd_row.eq(line_buffer.odd_row),
        m_axis.tdata.eq(bilinear.pixel),
    ]

    # What travels beside the pixel. Only the bits that act have a reset, so the others become shift registers.
    def delayed(name: str, signal: Any, clocks: int, reset_less: bool) -> Any:
        if not clocks:
            return signal
        stages = Signal(clocks, name=name, reset_less=reset_less)
        with m.If(enable):
            m.d.sync += stages.eq(Cat(signal, stages))
        return stages[-1]

    to_window, to_output = p.datapath.latency, p.pipeline_latency
    m.d.comb += [
        line_buffer.end_of_line.eq(delayed("row_end", issue & raster.end_of_line, to_window, False)),
        line_buffer.end_of_frame.eq(delayed("frame_end", raster.end_of_frame, to_window, True)),
        m_axis.tvalid.eq(delayed("valid", issue, to_output, False)),
        m_axis.tuser.eq(delayed("start_of_frame", raster.start_of_frame, to_output, True)),
        m_axis.tlast.eq(delayed("end_of_line", raster.end_of_line, to_output, True)),
    ]
