"""The registers at the streams lose no beat, make none up and keep their order."""

from amaranth import Module, Signal
from amaranth.asserts import AnySeq
from amaranth.hdl import Assert, Assume, Cover, Elaboratable

from hdl.stream.ports import InputRegister

from .axi import Stability, Stream
from .opened import Opened

BITS = 3  # of a beat's number; more than the beats that are held are told apart


class PortProof(Elaboratable):
    """Beats are numbered as they go in; so they come out, and stay until they are taken.

    Parameters
    ----------
    block : InputRegister or OutputSkid
        Of `BITS`.
    """

    def __init__(self, block, lemmas=True):
        self._block, self._lemmas = block, lemmas

    def elaborate(self, platform):
        m, block = Module(), self._block
        m.submodules.block = opened = Opened(block)
        sent, taken = Signal(BITS), Signal(BITS)
        ready = block.i_ready if isinstance(block, InputRegister) else block.enable
        m.d.comb += [block.i_valid.eq(AnySeq(1)), block.o_ready.eq(AnySeq(1)), block.i.eq(AnySeq(BITS))]
        m.d.comb += Assume(~block.i_valid | (block.i == sent), "beats are numbered")
        m.d.sync += [sent.eq(sent + (block.i_valid & ready)), taken.eq(taken + (block.o_valid & block.o_ready))]
        out = Stream("o", block.o, block.o_valid, block.o_ready, Signal(), Signal())
        m.submodules.stability = Stability(out)
        m.d.comb += Assert(~block.o_valid | (block.o == taken), "beats come out as they went in")
        if isinstance(block, InputRegister):
            held = block.o_valid
            m.d.comb += Assert(block.i_ready | (block.o_valid & ~block.o_ready), "only a beat that waits is waited for")
        else:
            standing = opened.registers["standing"]
            held = block.o_valid + standing
            m.d.comb += [
                Assert(block.running == block.enable, "both enables are the same"),
                Assert(block.enable | block.o_valid, "the pipeline stops only behind a beat"),
                Cover(standing & out.transfer & block.i_valid, "a beat that was set aside comes out"),
            ]
            if self._lemmas:
                is_next = opened.registers["aside"] == (taken + 1)[:BITS]
                m.d.comb += Assert(~standing | is_next, "lemma: what is set aside comes next")
        m.d.comb += Assert(sent == (taken + held)[:BITS], "the beats that are held are missing at the output")
        return m
