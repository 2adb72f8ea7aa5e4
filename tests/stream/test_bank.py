"""Banks: how they are divided into memories, and that this shows in nothing but the cost."""

import random

import pytest
from amaranth import Module, Signal

from hdl.arithmetic.cuts import Stages
from hdl.stream.bank import _BLOCKS, STACKED, STACKED_BLOCKS, Bank, BankLayout
from sim.drivers import pauses, simulate

DEPTHS = (1, 100, 2048, 2049, 8192, 8193, 16384, 16385, 32768, 32769, 65536, 65537, 99000)
WIDTHS = (8, 10, 12, 16, 24)


def covered(layout):
    """The word's bits in the order of the slices."""
    return [bit for low, bits in layout.slices for bit in range(low, low + bits)]


@pytest.mark.parametrize("depth", DEPTHS)
def test_without_blocks_slices_are_as_wide_as_lets_few_block_rams_be_stacked(depth):
    for width in WIDTHS:
        layout = BankLayout.of(depth, width)
        assert (layout.stack, layout.words, layout.latency) == (1, depth, 1)
        assert covered(layout) == list(range(width))
        # A block RAM of 36 Kbit, of so many bits a word, is so deep.
        deep = {1: 32768, 2: 16384, 4: 8192}
        if layout.slice_width < width:
            assert depth > STACKED * deep[4] // 2
            assert layout.slice_width == 1 or depth <= STACKED * deep[layout.slice_width]


@pytest.mark.parametrize("depth", DEPTHS)
def test_with_blocks_each_memory_is_one_and_no_other_layout_has_fewer(depth):
    for width in WIDTHS:
        layout = BankLayout.of(depth, width, blocks=True)
        assert layout.latency == 2
        assert covered(layout) == list(range(width))
        assert (layout.stack - 1) * layout.words < depth <= layout.stack * layout.words
        assert any(layout.words <= words and layout.slice_width <= bits for words, bits in _BLOCKS)
        counts = {words: (-(-depth // words), -(-width // bits)) for words, bits in _BLOCKS}
        # Where each way stacks too many, the deepest memories are taken.
        allowed = [count for count in counts.values() if count[0] <= STACKED_BLOCKS] or [counts[max(counts)]]
        assert layout.stack * len(layout.slices) == min(down * across for down, across in allowed)


LAYOUTS = {
    "one memory": BankLayout(20, 7, 20, 7),
    "slices": BankLayout(13, 7, 13, 3),
    "a stack": BankLayout(20, 5, 8, 5),
    "a registered memory": BankLayout(20, 7, 20, 7, registered=True),
    "a registered stack of slices": BankLayout(21, 9, 8, 4, registered=True),
}


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
@pytest.mark.parametrize("share", [0.0, 0.4], ids=["every clock", "with gaps"])
def test_words_are_read_as_they_were_written(layout, share):
    m = Module()
    bank = Bank(m, "bank", layout)
    enable, write = Signal(), Signal()
    write_address, read_address = Signal(range(layout.depth)), Signal(range(layout.depth))
    pixel = Signal(layout.width)
    bank.write(write, write_address, pixel)
    word = Signal(layout.width)
    m.d.comb += word.eq(bank.read(Stages(m, enable), enable, read_address))
    generator, gaps = random.Random(layout.depth), pauses(share, 1)

    async def testbench(ctx):
        held, reading = {}, []  # what is in the bank; what is on its way, the newest first
        for clock in range(400):
            moves = not next(gaps)
            writes = clock < layout.depth or generator.getrandbits(1)
            stored = (clock if clock < layout.depth else generator.randrange(layout.depth)) % layout.depth
            read = generator.choice([address for address in held if not (writes and address == stored)] or [None])
            value = generator.getrandbits(layout.width)
            ctx.set(enable, moves)
            ctx.set(write, writes)
            ctx.set(write_address, stored)
            ctx.set(pixel, value)
            if moves and read is not None:
                ctx.set(read_address, read)
            else:
                ctx.set(read_address, generator.randrange(layout.depth))
            await ctx.tick()
            if moves:
                reading = [held.get(read), *reading][: layout.latency]
            if writes:
                held[stored] = value
            # It stands while the enable is low.
            if len(reading) == layout.latency and reading[-1] is not None:
                assert ctx.get(word) == reading[-1]
        return len(held)

    assert simulate(m, testbench, clocks=1000) == [layout.depth]
