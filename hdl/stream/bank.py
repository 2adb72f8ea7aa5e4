"""How a bank of the line buffer is made of memories, and its ports."""

from dataclasses import dataclass

from amaranth import Array, Cat
from amaranth.lib.memory import Memory
from amaranth.utils import exact_log2

from hdl.arithmetic.cost import RAMB18

# Block RAMs on top of each other that still share an output cheaply; with a register behind each of them.
STACKED, STACKED_BLOCKS = 4, 6
# Those of a pixel's width; of a DP16KD they are the same (Lattice FPGA-TN-02204).
_BLOCKS = tuple(block for block in RAMB18 if block[1] <= 9)
# The read side never reads where the write side writes: without these Yosys builds for ECP5 what would make up for it.
_ATTRIBUTES = {"ram_style": "block", "no_rw_check": 1, "rw_addr_collision": "no"}


@dataclass(frozen=True)
class BankLayout:
    """Memories side by side and on top of each other.

    Parameters
    ----------
    depth, width : int
        Words, and bits of a word, of the bank.
    words : int
        Of each memory, a power of two unless there is one on top of the other only; the last has what is left.
    slice_width : int
        Bits of each memory; the last has what is left.
    registered : bool
        Whether there is a register behind each memory.
    """

    depth: int
    width: int
    words: int
    slice_width: int
    registered: bool = False

    @classmethod
    def of(cls, depth, width, blocks=False, narrow=False):
        """The layout of a bank of ``depth`` words of ``width`` bits, with ``narrow`` in slices of one bit.

        Without ``blocks`` it is for the tools to put block RAMs on each other: in slices of a word so narrow that these
        are `STACKED` at most, since their outputs take more look-up tables to choose from than narrower ones. With
        ``blocks`` each memory is one block RAM with a register behind it, `STACKED_BLOCKS` at most on each other, and
        as few of them as that takes.
        """
        if not blocks:
            if narrow:
                return cls(depth, width, depth, 1)
            slices = ((4096, width), (8192, 4), (16384, 2))
            return cls(depth, width, depth, next((bits for words, bits in slices if depth <= STACKED * words), 1))
        fitting = [block for block in _BLOCKS if depth <= STACKED_BLOCKS * block[0] and not narrow] or _BLOCKS[-1:]
        words, bits = min(fitting, key=lambda block: -(-depth // block[0]) * -(-width // block[1]))
        return cls(depth, width, words, min(bits, width), registered=True)

    @property
    def latency(self):
        """Enabled clocks from an address to its word."""
        return 1 + self.registered

    @property
    def stack(self):
        """Memories on top of each other."""
        return -(-self.depth // self.words)

    @property
    def slices(self):
        """(lowest bit, bits) of each memory of a row."""
        return [(low, min(self.slice_width, self.width - low)) for low in range(0, self.width, self.slice_width)]


class Bank:
    """The memories of a `BankLayout` in ``m``: simple dual-port memories with one registered read, never initialised.

    Parameters
    ----------
    m : Module
    name : str
        What the names of the memories begin with.
    layout : BankLayout
    """

    def __init__(self, m, name, layout):
        self._m, self._name, self._layout = m, name, layout
        self._ports = []  # of each memory on top of the other, by slices
        for index in range(layout.stack):
            ports = []
            for low, width in layout.slices:
                depth = min(layout.words, layout.depth - index * layout.words)
                memory = Memory(shape=width, depth=depth, init=[], attrs=_ATTRIBUTES)
                parts = [name] + [str(index)] * (layout.stack > 1) + [str(low)] * (len(layout.slices) > 1)
                m.submodules["_".join(parts)] = memory
                ports.append((memory.write_port(), memory.read_port()))
            self._ports.append(ports)

    def write(self, enable, address, pixel):
        """Store ``pixel`` at ``address`` in a clock with ``enable``."""
        for index, ports in enumerate(self._ports):
            for (low, _), (write, _) in zip(self._layout.slices, ports):
                self._m.d.comb += [
                    write.en.eq(enable & (self._memory(address) == index)),
                    write.addr.eq(address),
                    write.data.eq(pixel >> low),
                ]

    def read(self, stages, enable, address):
        """The word at ``address``, ``latency`` enabled clocks late."""
        words = []
        for ports in self._ports:
            for _, read in ports:
                self._m.d.comb += [read.en.eq(enable), read.addr.eq(address)]
            words.append(Cat(read.data for _, read in ports))
        if self._layout.registered:
            words = [stages.after(f"{self._name}_{index}_word", word) for index, word in enumerate(words)]
        if self._layout.stack == 1:
            return words[0]
        return Array(words)[stages.after(f"{self._name}_chosen", self._memory(address), self._layout.latency)]

    def _memory(self, address):
        """Which of the memories on top of each other an address is in."""
        return address[exact_log2(self._layout.words) :] if self._layout.stack > 1 else 0
