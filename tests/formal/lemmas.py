"""Why the window's assertions hold: relations between the design's registers and the counts, which are inductive."""

from amaranth import Array, Cat, Const, Mux, Signal, signed
from amaranth.lib.memory import Memory
from amaranth.utils import exact_log2

from .control import Control
from .core import bank_name


class WatchedMemory(Memory):
    """One more port, ``watch``, reads without a clock."""

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self.watch = self.read_port(domain="comb")


def window_lemmas(m, proof):
    """Add the lemmas of a `WindowProof` to its module."""
    height = proof.height
    control = Control(m, proof.core)
    lemma = control.lemma

    # The rows in and out, and `RowFlow`.
    base_out, row_out = Signal(proof.row_bits), Signal(proof.row_bits)
    with m.If(proof.core.issue & proof.datapath.end_of_frame):
        m.d.sync += base_out.eq(base_out + height)
    m.d.comb += row_out.eq(base_out + control.y)
    lemma(control.y_in == proof.y_in, "capture counts the rows of the frame")
    lemma(control.x == proof.x, "raster counts the columns")
    lemma(
        control.ahead == (proof.row_in - row_out - control.early)[: proof.row_bits],
        "flow counts how far the input is ahead",
    )
    base = base_out + Mux(control.early_frame, height, 0) + Mux(control.complete, height, 0)
    lemma(proof.row_in == (base + control.y_in)[: proof.row_bits], "complete is the frame that goes out")

    position_lemmas(m, proof, control, base_out)
    PlaceLemmas(m, proof, control).add()

    # Rows since the reset, until their numbers come round.
    rows_in = Signal(proof.row_bits)
    with m.If(proof.capture.row_written & ~rows_in.all()):
        m.d.sync += rows_in.eq(rows_in + 1)
    lemma(rows_in.all() | (rows_in == proof.row_in), "rows are numbered from the reset on")
    for base, name in ((base_out, "goes out"), *((p.base, "is read") for p in (proof.reading, *proof.windows))):
        lemma(rows_in.all() | (base <= proof.row_in), f"the frame that {name} came in after the reset")
    lemma(
        proof.present | proof.missing | (proof.row == proof.row_in) | ~(rows_in.all() | (proof.row < proof.row_in)),
        "every row that came in has the watched pixel or lacks it",
    )


def position_lemmas(m, proof, control, base_out):
    """Of the positions between raster and memories: they are in the raster's row or in the one before."""
    way, reading, windows, height, lemma = proof.on_the_way, proof.reading, proof.windows, proof.height, control.lemma
    registers, clocks = proof.core.registers, len(proof.on_the_way)

    def has_rows(base, y):
        since = Signal(proof.row_bits)
        m.d.comb += since.eq(proof.row_stored - base)
        return (since >= height) | (since > y + proof.window.lead)

    def same_or_before(position, y, base, before):
        """Whether the position is in row y of the frame, or, if so asked, in the row before."""
        first = y == 0
        return (position.y == Mux(before, Mux(first, height - 1, y - 1), y)) & (
            position.base == (base - Mux(before & first, height, 0))[: proof.row_bits]
        )

    stages = [*way, *windows]
    ends = Cat(stage.ends for stage in stages)
    lemma((ends & (ends - 1)[: len(ends)]) == 0, "no two rows end within the pipeline")
    for index, stage in enumerate(stages):
        lemma(~stage.ends | (stage.valid & (control.x <= index)), f"a row is longer than the pipeline, {index}")
        lemma(
            ~stage.valid | ends[: index + 1].any() | (control.x != 0),
            f"positions are in a row that has begun, {index}",
        )
    # What is said of the row is not reset: it is right once the pipeline moved, and was warm.
    filled = Signal(clocks + 1)
    m.d.comb += filled[0].eq(proof.core.warming == 0)
    if clocks:
        lemma(registers["row_end"] == Cat(stage.ends for stage in way), "row ends travel with positions")
        with m.If(proof.datapath.enable):
            m.d.sync += filled[1:].eq(filled)
        for index, stage in enumerate(way):
            last = Mux(ends[: index + 1].any(), control.y == 0, control.y == height - 1)
            is_filled = filled[index + 1]
            lemma(is_filled | ~((filled >> index + 1).any() | stage.valid), f"the pipeline fills, {index}")
            lemma(~is_filled | filled[index], f"the pipeline stays full, {index}")
            lemma(~is_filled | (registers["last_row"][index] == last), f"the last row is that of positions, {index}")
    behind = ends[:clocks].any() if clocks else Const(0)
    lemma(same_or_before(reading, control.y, base_out, behind), "reading is in the raster's row or behind")
    for index, (before, window) in enumerate(zip([reading, *windows], windows)):
        lemma(
            same_or_before(window, before.y, before.base, window.ends), f"windows are in their row or behind, {index}"
        )
        lemma(~window.valid | has_rows(window.base, window.y), f"a window has its source rows, {index}")
        lemma(~window.valid | proof.in_window(window), f"windows are as the core was built for, {index}")
    lemma((control.x == 0) | has_rows(base_out, control.y), "a row that has begun has its source rows")
    lemma(~behind | has_rows(reading.base, reading.y), "a row that is ending has its source rows")
    if proof.parameters.pipeline.ring:
        _row_ahead_lemmas(m, proof, lemma, filled[-1])


def _row_ahead_lemmas(m, proof, lemma, filled):
    """Of what the ring computes of the next row: it is right two clocks later, and a row has more positions."""
    reading, registers, height = proof.reading, proof.core.registers, proof.height
    rows = proof.parameters.line_buffer.rows
    first, offset, passes_end, following = (
        registers[f"line_buffer.{name}"] for name in ("first", "offset", "passes_end", "following")
    )
    settled = Signal(range(3))
    m.d.sync += settled.eq(Mux(~filled | (proof.datapath.enable & reading.ends), 0, settled + (settled != 2)))
    lemma(settled <= 2, "two clocks are enough")
    lemma((settled == 0) | (passes_end == (first == rows - 1)), "passes_end is of the row in progress")
    expected = offset + Mux(first == rows - 1, rows, 0) - Mux(reading.y == height - 1, height, 0)
    lemma((settled != 2) | (following == expected[: len(following)]), "following is of the next row")
    stages = [proof.issued, *proof.on_the_way]
    for index, (newer, older) in enumerate(zip(stages, stages[1:])):
        moved = newer.x != 0 if index == 0 else newer.valid & (newer.x != 0)
        lemma(~moved | (older.valid & (older.x == newer.x - 1)), f"a row's positions have no gaps, {index}")
        lemma(older.ends == (older.valid & (older.x == proof.width - 1)), f"rows end with their last position, {index}")
    begun = reading.valid if proof.on_the_way else Const(1)
    lemma(~begun | (settled >= Mux(reading.x > 1, 2, reading.x)), "a row takes longer than its next one's place")


class PlaceLemmas:
    """Lemmas of places in the ring, from the coordinates to the taps, and of the watched pixel's place.

    Parameters
    ----------
    m : Module
    proof : WindowProof
    control : Control
    """

    def __init__(self, m, proof, control):
        self._m, self._proof, self._control, self._lemma = m, proof, control, control.lemma
        self._buffer, self._registers = proof.parameters.line_buffer, proof.core.registers
        self._write_slot = Signal(range(self._buffer.rows))

    def add(self):
        m, proof, lemma, buffer = self._m, self._proof, self._lemma, self._buffer
        slot, rows = self._write_slot, buffer.rows
        with m.If(proof.capture.row_written):
            m.d.sync += slot.eq(Mux(slot == rows - 1, 0, slot + 1))
        lemma(slot < rows, "slots are those of the ring")
        lemma(self._register("odd_slot") == slot[0], "the row comes in at its slot's pair of banks")
        lemma(self._register("base") == (slot >> 1) * buffer.pitch, "the row comes in at its slot")

        lowest, reading = buffer.window.d_lo - 1, proof.reading
        age = Signal(signed(proof.row_bits))
        m.d.comb += age.eq(proof.row_in - reading.base - reading.y - lowest)
        first, offset = self._register("first"), self._register("offset")
        lemma(first == self._slot_of(age, least=min(0, -lowest)), "first is the slot of the lowest row")
        lemma(offset == (reading.y + lowest - first)[: len(offset)], "offset is the row that slot 0 stands for")

        for stage, position in enumerate(proof.windows):
            self._window(stage, position)
        for stage, taps in enumerate([proof.read, *proof.taps], start=len(proof.windows) - 1):
            self._taps(stage, taps)
        self._stored(self._pending() if proof.parameters.pipeline.writes else Const(0))

    def _register(self, name, stage=0, clocks=1):
        """A register of the line buffer; of those of several clocks the one so many clocks behind the first."""
        register = self._registers[f"line_buffer.{name}"]
        width = len(register) // clocks
        return register[stage * width : (stage + 1) * width]

    def _slot_of(self, age, least=0):
        """Where the row is, or will be, that comes in ``age`` rows before the one that comes in: least <= age < 2
        * rows."""
        rows, place = self._buffer.rows, Signal(signed(self._proof.row_bits + 2))
        self._m.d.comb += place.eq(self._write_slot - age)
        slot = place + 2 * rows
        for rounds in range(1, least // rows - 2, -1):
            slot = Mux(place >= -rounds * rows, place + rounds * rows, slot)
        return slot

    def _address(self, slot, column):
        return (slot >> 1) * (self._buffer.pitch * self._buffer.granule) + (column >> 1)

    def _window(self, stage, position):
        """Of a window before it is read."""
        m, proof, lemma, buffer = self._m, self._proof, self._lemma, self._buffer
        whole, clocks = proof.whole(position), buffer.place_latency
        (column, fraction_x, inside_x), (row, fraction_y, inside_y) = whole["x"], whole["y"]
        is_read = position.valid & Cat(inside_x).any() & Cat(inside_y).any()
        age, slot = Signal(proof.row_bits), Signal(range(buffer.rows))
        m.d.comb += [age.eq(proof.row_in - position.base - row), slot.eq(self._slot_of(age))]
        if stage < clocks:
            known = self._register("column", stage, clocks)
            facts = [("column", column[: len(known)]), ("fraction_x", fraction_x), ("fraction_y", fraction_y)]
            facts += [("column_inside", Cat(inside_x)), ("row_inside", Cat(inside_y))]
            for name, fact in facts:
                lemma(~position.valid | (self._register(name, stage, clocks) == fact), f"{name}, {stage}")
        if stage == 0 and "line_buffer.slot" in self._registers:
            lemma(~is_read | (self._register("slot") == slot), "the slot is the one in which the row came in")
        if stage == clocks - 1 and "line_buffer.odd_row" in self._registers:
            below = Mux(slot == buffer.rows - 1, 0, slot + 1)
            lemma(~is_read | (self._register("odd_row") == slot[0]), "which pair of banks the row came in at")
            for name, place in (("odd_base", slot), ("even_base", Mux(slot[0], below, slot))):
                lemma(~is_read | (self._register(name) == (place >> 1) * buffer.pitch), f"{name} is the slot's")
        if stage == clocks:  # behind registers for the addresses
            for dy, dx in proof.read.inside:
                bank = [parity for parity in proof.read.bank(dy, dx)]
                place = slot if not dy else Mux(slot == buffer.rows - 1, 0, slot + 1)
                addresses = [[self._register(f"address_{r}_{c}") for c in range(2)] for r in range(2)]
                address = Array(addresses[0] + addresses[1])[Cat(bank[1], bank[0])]
                inside = position.valid & inside_x[dx] & inside_y[dy]
                lemma(~inside | (address == self._address(place, column + dx)), f"the address of tap ({dy}, {dx})")
                lemma(~inside | (Cat(bank) == Cat(place[0], (column + dx)[0])), f"the bank of tap ({dy}, {dx})")

    def _taps(self, stage, taps):
        """Of a window from the clock in which it is read on."""
        proof, lemma, buffer = self._proof, self._lemma, self._buffer
        behind = stage - len(proof.windows)
        begin, clocks = buffer.place_latency, proof.parameters.pipeline.address + buffer.bank.latency
        for dy, dx in taps.inside:
            bank = Cat(*reversed(taps.bank(dy, dx)))
            if behind >= 0:
                lemma(
                    ~taps.watched[dy, dx] | taps.inside[dy, dx], f"what is watched of ({dy}, {dx}) is inside, {stage}"
                )
            banks = [(row, column) for row in range(2) for column in range(2)]
            if 0 <= stage - begin < clocks:
                known = [self._register(f"inside_{r}_{c}", stage - begin, clocks) for r, c in banks]
                inside = 1 if proof.replicated else taps.inside[dy, dx]
                lemma(~taps.valid | (Array(known)[bank] == inside), f"whether tap ({dy}, {dx}) is inside, {stage}")
            if 0 <= behind < buffer.bank.latency:
                words = [self._word(behind, row, column) for row, column in banks]
                given = Array(words)[bank][: len(proof.tag(proof.column, proof.row))]
                watched = taps.valid & taps.watched[dy, dx]
                lemma(~watched | (given == proof.tag(proof.column, proof.row)), f"the word of ({dy}, {dx}), {stage}")

    def _word(self, behind, row, column):
        """The word that was read from a bank, so many clocks after it came out of the memory."""
        layout, name = self._buffer.bank, bank_name(row, column)
        words = [
            self._register(f"{name}_{index}_word") if behind else Cat(memory.read_ports[-1].data for memory in memories)
            for index, memories in enumerate(self._proof.core.bank(row, column))
        ]
        if layout.stack == 1:
            return words[0]
        return Array(words)[self._register(f"{name}_chosen", behind, layout.latency)]

    def _pending(self):
        """Lemmas of the registers before the memories; the watched pixel is in them."""
        m, proof, lemma = self._m, self._proof, self._lemma
        valid, new = Signal(), Signal(init=1)
        slot, column, row = Signal.like(self._write_slot), Signal(proof.column_bits), Signal(proof.row_bits)
        m.d.sync += [
            new.eq(0),
            valid.eq(proof.capture.write),
            slot.eq(self._write_slot),
            column.eq(proof.capture.x),
            row.eq(proof.row_in),
        ]
        for r in range(2):
            for c in range(2):
                here = valid & (slot[0] == r) & (column[0] == c)
                lemma(new | (self._register(f"write_{r}_{c}") == here), f"which bank is written, {r}, {c}")
        lemma(~new | ~(valid | proof.present), "before the first pixel nothing is there")
        pixel, address = self._register("write_pixel"), self._register("write_address")
        tag = proof.tag(column, row)
        lemma(~valid | (pixel[: len(tag)] == tag), "the pixel that is written")
        lemma(~valid | (address == self._address(slot, column)), "the address that is written")
        before = Mux(self._write_slot == 0, self._buffer.rows - 1, self._write_slot - 1)
        lemma(
            ~valid
            | Mux(
                proof.just_written,
                (row == (proof.row_in - 1)[: proof.row_bits]) & (slot == before) & (column < proof.width),
                (row == proof.row_in) & (slot == self._write_slot) & (column < self._control.x_in),
            ),
            "what is written came in before",
        )
        lemma(~proof.just_written | (self._control.x_in == 0), "a row begins")
        end = self._register("base") == (self._buffer.rows // 2 - 1) * self._buffer.pitch
        lemma(~self._register("odd_slot") | (self._register("end") == end), "the ring's end is known in time")
        return valid & (row == proof.row) & (column == proof.column)

    def _stored(self, pending):
        """The watched pixel is in its place while its row is kept."""
        m, proof, lemma, buffer = self._m, self._proof, self._lemma, self._buffer
        age, slot = Signal(proof.row_bits), Signal(range(buffer.rows))
        m.d.comb += [age.eq(proof.row_in - proof.row), slot.eq(self._slot_of(age))]
        address, words = Signal(range(buffer.depth + 1)), []
        m.d.comb += address.eq(self._address(slot, proof.column))
        for row in range(2):
            for column in range(2):
                stack = []
                for memories in proof.core.bank(row, column):
                    m.d.comb += [memory.watch.addr.eq(address) for memory in memories]
                    stack.append(Cat(memory.watch.data for memory in memories))
                chosen = address[exact_log2(buffer.bank.words) :] if buffer.bank.stack > 1 else 0
                words.append(Array(stack)[chosen] if len(stack) > 1 else stack[0])
        tag = proof.tag(proof.column, proof.row)
        word = Array(words)[Cat(proof.column[0], slot[0])][: len(tag)]
        is_kept = (age < buffer.rows) | ((age == buffer.rows) & (self._control.x_in == 0))
        lemma(~proof.present | (proof.column < proof.width), "only pixels of the source come in")
        lemma(
            ~(proof.present & is_kept) | pending | (word == tag),
            "the watched pixel is in its place until its slot's next row comes in",
        )
