"""Small whole cores in Amaranth's simulator: random frames in, the frames that come out."""

import random
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import rigs
from amaranth import Module, Signal
from amaranth.lib import wiring
from amaranth.lib.memory import Memory

from hdl.arithmetic.cuts import BALANCED
from hdl.datapaths import DATAPATHS
from hdl.datapaths.base import Datapath
from hdl.geometry.coordinates import Coordinates
from hdl.stream.rectifier import Rectifier, RectifierParameters
from sim.beats import BEAT, to_beats, to_frames
from sim.drivers import CORE_DOMAIN, axis, bench, receive, send, simulate
from sim.remap import remap

WIDTH, HEIGHT = 24, 18


def parameters(name="proposed", view=None, fraction_bits=5, pipeline=BALANCED, **formats):
    datapath = DATAPATHS[name].fit(view or rigs.view("samples"), fraction_bits)
    return RectifierParameters(datapath.with_pipeline(pipeline), **formats)


def random_frames(p, count, seed=0):
    shape = (count, p.datapath.height, p.datapath.width) + ((3,) if p.channels == 3 else ())
    dtype = np.uint8 if p.pixel_bits == 8 else np.uint16
    return np.random.default_rng(seed).integers(0, 2**p.pixel_bits, shape, dtype)


def stream_of(p, frames):
    """Beats (tdata, tuser, tlast); the bits of tdata above the pixel are noise."""
    noise = random.Random(len(frames))
    above = p.channels * p.pixel_bits
    return [
        (int(beat["data"]) | noise.getrandbits(p.tdata_width) >> above << above, int(beat["user"]), int(beat["last"]))
        for beat in to_beats(frames, channels=p.channels, pixel_bits=p.pixel_bits)
    ]


def frames_of(p, received):
    """The frames in what came out; raises StreamError for flags out of place and for bits above the pixel."""
    beats = np.array([(data, clock, 0, user, last) for clock, data, user, last in received], BEAT)
    return to_frames(beats, p.datapath.width, p.datapath.height, channels=p.channels, pixel_bits=p.pixel_bits)


def rectified(p, frame):
    used = p.datapath.coordinates
    return remap(frame, used.u, used.v, used.fraction_bits, p.border.mode, p.border.value)


def run(p, beats, frames, idle, backpressure, *more):
    """Send ``beats``, take ``frames`` frames; the clocks of the beats in, the beats out, what ``more`` benches say."""
    core = Rectifier(p)
    count = frames * p.datapath.width * p.datapath.height
    return simulate(
        bench(core),
        send(axis(core, "s_axis"), beats, idle, CORE_DOMAIN),
        receive(axis(core, "m_axis"), count, backpressure, CORE_DOMAIN, settle=3 * p.datapath.width),
        *(testbench(core) for testbench in more),
        clocks=10 * (len(beats) + count) + 1000,
        domain=CORE_DOMAIN,
    )


def check(p, count, idle, backpressure, *more, seed=0):
    """``count`` random frames in, the same rectified frames out; returns the clocks of both sides and of ``more``."""
    frames = random_frames(p, count, seed)
    sent, received, *rest = run(p, stream_of(p, frames), count, idle, backpressure, *more)
    assert len(received) == len(sent)
    out = frames_of(p, received)
    for index, frame in enumerate(frames):
        np.testing.assert_array_equal(out[index], rectified(p, frame))
    return sent, [clock for clock, *_ in received], *rest


@dataclass(frozen=True, eq=False)
class Table(Datapath):
    """Any coordinates at all, from a ROM, as late as wanted."""

    u: np.ndarray
    v: np.ndarray
    clocks: int

    formats = {}

    @classmethod
    def fit(cls, view, fraction_bits, max_error=None):
        raise AssertionError("made of its coordinates")

    @cached_property
    def coordinates(self):
        return Coordinates(self.u, self.v, self.fraction_bits)

    @property
    def cost(self):
        raise AssertionError("never a candidate")

    @property
    def latency(self):
        return self.clocks

    def component(self):
        return Rom(self)


class Rom(wiring.Component):
    def __init__(self, table):
        self.table = table
        super().__init__(table.signature)

    def elaborate(self, _platform):
        m = Module()
        address = Signal(range(self.table.u.size))
        m.d.comb += address.eq(self.y * self.table.width + self.x)
        for name, out in (("u", self.u), ("v", self.v)):
            values = [int(value) for value in getattr(self.table, name).ravel()]
            m.submodules[name] = memory = Memory(shape=out.shape(), depth=len(values), init=values)
            port = memory.read_port(domain="comb")
            value = port.data
            m.d.comb += port.addr.eq(address)
            for _ in range(self.table.latency):
                register = Signal.like(value)
                with m.If(self.enable):
                    m.d.sync += register.eq(value)
                value = register
            m.d.comb += out.eq(value)
        return m


def random_map(width, height, d_lo, d_hi, latency, pipeline, fraction_bits=5):
    """A `Table` with the window d_lo, d_hi, mostly at its ends, and in every column.

    There are the row that is overwritten next and the one that came in last. The last positions of each row, which are
    still in flight when the next row begins, look at the first column, which is overwritten first.
    """
    generator = np.random.default_rng(latency - d_lo + 10)
    tops = generator.choice([d_lo, d_lo, d_hi - 1, d_hi - 1, *range(d_lo, d_hi)], (height, width))
    one = 2**fraction_bits
    v = (np.arange(height)[:, None] + tops) * one + generator.integers(0, one, tops.shape)
    u = generator.integers(-one, (width + 1) * one, tops.shape)
    u[:, -4:] = generator.integers(0, one, (height, 4))
    return Table(width, height, fraction_bits, u.astype(np.int32), v.astype(np.int32), latency, pipeline=pipeline)
