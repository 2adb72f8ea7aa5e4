"""Small blocks with the ports of an exported core, sound and faulty, and streams for them."""

import numpy as np
from amaranth import ClockDomain, ClockSignal, Module, ResetSignal, Signal
from amaranth.lib import wiring
from amaranth.lib.fifo import SyncFIFOBuffered
from amaranth.lib.wiring import In, Out

import hdl  # noqa: F401  chooses Amaranth's Yosys
from sim.beats import BEAT


class Block(wiring.Component):
    """The ports of an exported core, their clock and reset, and the payload of each side in one signal."""

    def __init__(self, bits=8):
        self.bits = bits
        super().__init__(
            {"aclk": In(1), "aresetn": In(1)}
            | {
                f"{side}_axis_{name}": flow(width)
                for side, forward, backward in (("s", In, Out), ("m", Out, In))
                for name, flow, width in (
                    ("tdata", forward, bits),
                    ("tvalid", forward, 1),
                    ("tready", backward, 1),
                    ("tuser", forward, 1),
                    ("tlast", forward, 1),
                )
            }
        )

    def elaborate(self, _platform):
        m = Module()
        m.domains.sync = ClockDomain("sync", local=True)
        m.d.comb += [ClockSignal().eq(self.aclk), ResetSignal().eq(~self.aresetn)]
        i, o = Signal(self.bits + 2), Signal(self.bits + 2)
        m.d.comb += [
            i.eq(self.s_axis_tdata | self.s_axis_tuser << self.bits | self.s_axis_tlast << self.bits + 1),
            self.m_axis_tdata.eq(o[: self.bits]),
            self.m_axis_tuser.eq(o[self.bits]),
            self.m_axis_tlast.eq(o[self.bits + 1]),
        ]
        self.body(m, i, o)
        return m


class Slice(Block):
    """One register, with a combinational path from m_axis_tready to s_axis_tready; or with a fault."""

    def __init__(self, fault=None):
        self.fault = fault
        super().__init__()

    def body(self, m, i, o):
        valid, free, taken, count = Signal(), Signal(), Signal(), Signal(8)
        m.d.comb += [
            free.eq(~valid | self.m_axis_tready),
            self.s_axis_tready.eq(free),
            taken.eq(self.s_axis_tready & self.s_axis_tvalid),
            self.m_axis_tvalid.eq(valid),
        ]
        m.d.sync += count.eq(count + taken)
        with m.If(free):
            m.d.sync += [valid.eq(taken), o.eq(i)]
        match self.fault:
            case "changes while waiting":
                with m.If(~free):
                    m.d.sync += o.eq(o + 1)
            case "takes valid back":
                pause = Signal()
                m.d.sync += pause.eq(~free & ~pause)
                m.d.comb += [self.m_axis_tvalid.eq(valid & ~pause), free.eq(~valid | self.m_axis_tready & ~pause)]
            case "valid in reset":
                m.d.comb += self.m_axis_tvalid.eq(valid | ~self.aresetn)
            case "hangs":
                m.d.comb += self.s_axis_tready.eq(free & (count != 50))
            case "repeats the last":
                with m.If(free & ~taken & valid & o[-1]):
                    m.d.sync += [valid.eq(1), o.eq(o), o[-1].eq(0)]


class Fifo(Block):
    """Sixteen beats deep; with the fault it says ready even when it is full."""

    def __init__(self, bits=24, drops=False):
        self.drops = drops
        super().__init__(bits)

    def body(self, m, i, o):
        m.submodules.fifo = fifo = SyncFIFOBuffered(width=len(i), depth=16)
        m.d.comb += [
            fifo.w_data.eq(i),
            fifo.w_en.eq(self.s_axis_tvalid),
            self.s_axis_tready.eq(1 if self.drops else fifo.w_rdy),
            o.eq(fifo.r_data),
            fifo.r_en.eq(self.m_axis_tready),
            self.m_axis_tvalid.eq(fifo.r_rdy),
        ]


class Tally(Block):
    """Passes tuser and tlast; tdata counts beats, the low half since the reset and the high half since power-up."""

    def body(self, m, i, o):
        since_reset, since_power_up = Signal(4), Signal(4, reset_less=True)
        m.d.comb += [
            self.s_axis_tready.eq(self.m_axis_tready),
            self.m_axis_tvalid.eq(self.s_axis_tvalid),
            o.eq(since_reset | since_power_up << 4 | i[8:] << 8),
        ]
        with m.If(self.s_axis_tvalid & self.m_axis_tready):
            m.d.sync += [since_reset.eq(since_reset + 1), since_power_up.eq(since_power_up + 1)]


PORTS = """\
module block(input aclk, input aresetn,
  input [7:0] s_axis_tdata, input s_axis_tvalid, output s_axis_tready, input s_axis_tuser, input s_axis_tlast,
  output [7:0] m_axis_tdata, output m_axis_tvalid, input m_axis_tready, output m_axis_tuser, output m_axis_tlast);
"""
WIRES = """\
  assign s_axis_tready = m_axis_tready, m_axis_tvalid = s_axis_tvalid;
  assign m_axis_tdata = s_axis_tdata, m_axis_tuser = s_axis_tuser, m_axis_tlast = s_axis_tlast;
"""
WIRE = f"{PORTS}{WIRES}endmodule\n"


def stream(length, bits=8, seed=0):
    rng = np.random.default_rng(seed)
    beats = np.zeros(length, BEAT)
    beats["data"] = rng.integers(0, 1 << bits, length)
    beats["user"], beats["last"] = rng.integers(0, 2, (2, length))
    return beats


def assert_same(got, want):
    for field in ("data", "user", "last"):
        np.testing.assert_array_equal(got[field], want[field], err_msg=field)
