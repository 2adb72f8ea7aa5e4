"""The core: an AXI4-Stream of source frames in, an AXI4-Stream of rectified frames out."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from amaranth import Cat, ClockDomain, ClockSignal, Module, ResetSignal, Signal
from amaranth.lib import stream, wiring
from amaranth.lib.data import StructLayout
from amaranth.lib.wiring import In, Out

from hdl.arithmetic.cuts import Pipeline, Stages
from hdl.datapaths.base import Datapath
from hdl.geometry.coordinates import Border
from hdl.stream import bilinear
from hdl.stream.capture import Capture
from hdl.stream.flow import RowFlow
from hdl.stream.issue import Issue
from hdl.stream.linebuffer import LineBuffer, LineBufferParameters
from hdl.stream.ports import InputRegister, OutputSkid
from hdl.stream.raster import NEAR, Raster

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
        For pixel formats there are not and border values that do not fit; on access to ``line_buffer``, for frames too
        small for their map and rows too short for the pipeline.
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

    @property
    def pipeline(self) -> Pipeline:
        """The datapath's, and that of all else."""
        return self.datapath.pipeline

    @cached_property
    def line_buffer(self) -> LineBufferParameters:
        """The `LineBufferParameters`; its window is that of the integer model's taps, at every pixel."""
        datapath = self.datapath
        coordinates = datapath.coordinates
        u, v = datapath.coordinate_formats
        line_buffer = LineBufferParameters(
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
            pipeline=self.pipeline,
        )
        # From the count of a row as issued to the last of its reads.
        in_flight = datapath.latency + line_buffer.latency - self.pipeline.taps + NEAR * self.pipeline.ahead
        if max(in_flight, datapath.warm_up) >= datapath.width:
            raise ValueError(f"a row of {datapath.width} px is shorter than the pipeline")
        return line_buffer

    @property
    def tdata_width(self) -> int:
        """Bits of tdata: the pixel, padded to whole bytes."""
        return -(-self.pixel_bits * self.channels // 8) * 8

    @property
    def pipeline_latency(self) -> int:
        """Clocks from the issue of a position to its pixel at m_axis."""
        interpolation = bilinear.latency(self.datapath.fraction_bits, self.pipeline)
        return self.datapath.latency + self.line_buffer.latency + interpolation + self.pipeline.ports

    @property
    def latency_cycles(self) -> int:
        """Clocks from the beat that brings a frame's first pixel to the beat that takes the first one away.

        With input without blanking and an output that is always ready.
        """
        # A beat that is registered, and a permission that is.
        waits = self.pipeline.ports + self.pipeline.ahead
        return (self.line_buffer.window.lead + 1) * self.datapath.width + waits + self.pipeline_latency


class Rectifier(wiring.Component):
    """A streaming rectifier: one pixel per clock, no frame buffer, no external memory.

    Source pixels go to the line buffer; once the rows are there that an output row needs, its positions are issued one
    a clock, turned into source coordinates by the datapath, into a 2x2 window by the line buffer and into a pixel by
    the interpolator. The whole read side moves on unless a pixel waits at ``m_axis``; the write side does not wait for
    it except through `RowFlow`. ``s_axis_tready`` does not depend on ``m_axis_tready`` within a clock; with
    ``pipeline.ports`` no output port depends on any input port.

    Throughput: 1 px/clock. For input in whole frames, with or without blanking, and an output that has taken every beat
    at once since the reset, ``s_axis_tready`` is never low. Whatever comes in and however the output pauses: counted
    from the reset, beats at ``s_axis`` wait for no more clocks than beats at ``m_axis`` waited and pixels, or the tlast
    at a frame's end, were missing from lines and frames that were too short. There is no line of slack: the first of
    these clocks may be the one after the pause, less what blanking made up for. (Proved for every pipeline:
    `ZeroStallProof`, `WaitsProof`.)
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
    width, height, ahead = p.datapath.width, p.datapath.height, p.pipeline.ahead
    m.submodules.capture = capture = Capture(width, height, ahead)
    m.submodules.flow = flow = RowFlow(p.line_buffer.window.lead, ahead)
    m.submodules.raster = raster = Raster(width, height, p.datapath.warm_up, ahead)
    m.submodules.issuing = issue = Issue(p.datapath.warm_up > 0, ahead)
    m.submodules.datapath = datapath = p.datapath.component()
    m.submodules.line_buffer = line_buffer = LineBuffer(p.line_buffer)
    m.submodules.bilinear = interpolator = bilinear.Bilinear(
        p.pixel_bits,
        p.channels,
        p.datapath.fraction_bits,
        p.line_buffer.latency - p.line_buffer.place_latency,
        p.pipeline,
    )

    # The clock enable of all between raster and output, and the same for logic.
    enable = Signal()
    running = Signal()
    _connect_input(m, p, s_axis, capture, line_buffer)
    stages = Stages(m, enable)
    to_window, to_output = p.datapath.latency, p.pipeline_latency - p.pipeline.ports
    m.d.comb += [
        # rows in and rows out
        capture.may_write.eq(flow.may_write),
        flow.row_written.eq(capture.row_written),
        flow.frame_written.eq(capture.frame_written),
        flow.row_issued.eq(issue.row_issued),
        flow.frame_issued.eq(issue.frame_issued),
        # raster positions to coordinates
        issue.enable.eq(running),
        issue.may_issue.eq(flow.may_issue),
        issue.end_of_line.eq(raster.end_of_line),
        issue.last_row.eq(raster.last_row),
        issue.near_end.eq(raster.near_end),
        raster.step.eq(issue.step),
        datapath.enable.eq(running),
        datapath.step.eq(issue.step),
        datapath.x.eq(raster.x),
        datapath.y.eq(raster.y),
        datapath.end_of_line.eq(raster.end_of_line),
        datapath.end_of_frame.eq(raster.end_of_line & raster.last_row),
        # coordinates to windows to pixels
        line_buffer.enable.eq(enable),
        line_buffer.u.eq(datapath.u),
        line_buffer.v.eq(datapath.v),
        line_buffer.end_of_line.eq(
            stages.after("row_end", issue.issue & raster.end_of_line, to_window, reset_less=False)
        ),
        line_buffer.last_row.eq(stages.after("last_row", raster.last_row, to_window)),
        interpolator.enable.eq(enable),
        interpolator.taps.eq(line_buffer.taps),
        interpolator.fx.eq(line_buffer.fx),
        interpolator.fy.eq(line_buffer.fy),
        interpolator.odd_column.eq(line_buffer.odd_column),
        interpolator.odd_row.eq(line_buffer.odd_row),
    ]
    # What travels beside the pixel. Only the bits that act have a reset, so the others become shift registers.
    valid = stages.after("valid", issue.issue, to_output, reset_less=False)
    start_of_frame = stages.after("start_of_frame", raster.start_of_frame, to_output)
    end_of_line = stages.after("end_of_line", raster.end_of_line, to_output)
    if p.pipeline.ports:
        beat = Cat(interpolator.pixel, start_of_frame, end_of_line)
        m.submodules.skid = skid = OutputSkid(len(beat))
        m.d.comb += [
            enable.eq(skid.enable),
            running.eq(skid.running),
            skid.i.eq(beat),
            skid.i_valid.eq(valid),
            skid.o_ready.eq(m_axis.tready),
            m_axis.tvalid.eq(skid.o_valid),
            Cat(m_axis.tdata[: len(interpolator.pixel)], m_axis.tuser, m_axis.tlast).eq(skid.o),
        ]
    else:
        m.d.comb += [
            enable.eq(~m_axis.tvalid | m_axis.tready),
            running.eq(enable),
            m_axis.tvalid.eq(valid),
            m_axis.tdata.eq(interpolator.pixel),
            m_axis.tuser.eq(start_of_frame),
            m_axis.tlast.eq(end_of_line),
        ]


def _connect_input(
    m: Module, p: RectifierParameters, s_axis: _Pixels, capture: Capture, line_buffer: LineBuffer
) -> None:
    """From the stream, or a register behind it, to the pixels of the line buffer."""
    beat = Cat(s_axis.tdata[: p.pixel_bits * p.channels], s_axis.tuser, s_axis.tlast)
    valid = s_axis.tvalid
    if p.pipeline.ports:
        m.submodules.input_register = register = InputRegister(len(beat))
        m.d.comb += [
            register.i.eq(beat),
            register.i_valid.eq(valid),
            s_axis.tready.eq(register.i_ready),
            register.o_ready.eq(capture.ready),
        ]
        beat, valid = register.o, register.o_valid
    else:
        m.d.comb += s_axis.tready.eq(capture.ready)
    m.d.comb += [
        capture.valid.eq(valid),
        capture.sof.eq(beat[-2]),
        capture.eol.eq(beat[-1]),
        line_buffer.write.eq(capture.write),
        line_buffer.x.eq(capture.x),
        line_buffer.pixel.eq(beat[:-2]),
        line_buffer.row_written.eq(capture.row_written),
    ]
