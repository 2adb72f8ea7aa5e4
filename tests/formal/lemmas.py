"""Why the window's assertions hold: relations between the design's registers and the counts, which are inductive."""

from amaranth import Array, Cat, Const, Mux, Signal, signed
from amaranth.hdl import Assert
from amaranth.lib.memory import Memory


class WatchedMemory(Memory):
    """One more port, ``watch``, reads without a clock."""

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self.watch = self.read_port(domain="comb")


def issued_position(m, core):
    """The next position to be issued, (x, y), with the lemmas that it is what the raster counts once it is warm."""
    width, height = core.parameters.datapath.width, core.parameters.datapath.height
    raster_x, raster_y = core.registers["raster.x"], core.registers["raster.y"]
    x, y, is_warm = Signal.like(raster_x), Signal.like(raster_y), core.warming == 0
    m.d.comb += [x.eq(Mux(is_warm, raster_x, 0)), y.eq(Mux(is_warm, raster_y, 0))]
    m.d.comb += [
        Assert((x < width) & (y < height), "lemma: raster counts positions"),
        Assert(core.warming <= core.parameters.datapath.warm_up, "lemma: warming up is counted down"),
        Assert(
            is_warm | ((raster_x == width - core.warming) & (raster_y == height - 1)),
            "lemma: raster begins before the frame, to warm up",
        ),
        Assert(
            ~is_warm | (core.registers["raster.start_of_frame"] == ((x == 0) & (y == 0))),
            "lemma: raster starts its frame",
        ),
    ]
    if core.parameters.datapath.warm_up:
        m.d.comb += Assert(core.registers["warm"] == is_warm, "lemma: it is warm after so many steps")
    return x, y


def window_lemmas(m, proof):
    """Add the lemmas of a `WindowProof` to its module."""
    registers, height = proof.core.registers, proof.height
    buffer = proof.parameters.line_buffer
    rows, lead = buffer.rows, buffer.window.lead

    def lemma(fact, name):
        m.d.comb += Assert(fact, f"lemma: {name}")

    # The rows in and out, and `RowFlow`.
    y_in = registers["capture.y"]
    x_out, y_out = issued_position(m, proof.core)
    base_out, row_out = Signal(proof.row_bits), Signal(proof.row_bits)
    with m.If(proof.core.issue & proof.datapath.end_of_frame):
        m.d.sync += base_out.eq(base_out + height)
    ahead = Signal(proof.row_bits)
    m.d.comb += [row_out.eq(base_out + y_out), ahead.eq(proof.row_in - row_out)]
    lemma((y_in == proof.y_in) & (y_in < height), "capture counts the rows")
    lemma(registers["capture.x"] <= proof.width, "capture's column is one of a line's")
    lemma(x_out == proof.on_the_way.x, "raster counts the columns")
    lemma((ahead == registers["flow.ahead"]) & (ahead <= lead + 2), "flow counts how far the input is ahead")
    lemma(
        proof.row_in == (base_out + y_in + Mux(registers["flow.complete"], height, 0))[: proof.row_bits],
        "complete is the frame that goes out",
    )
    lemma((ahead != lead + 2) | (registers["capture.x"] == 0), "with the buffer full no row is begun")

    _pipeline_lemmas(m, proof, lemma, x_out, y_out, base_out)

    # Places in the ring.
    write_slot = Signal(range(rows))
    with m.If(proof.capture.row_written):
        m.d.sync += write_slot.eq(Mux(write_slot == rows - 1, 0, write_slot + 1))

    def slot_of(age, least=0):
        """Where the row is, or will be, that comes in ``age`` rows before the one that comes in: least <= age < 2
        * rows."""
        place = Signal(signed(proof.row_bits + 2))
        m.d.comb += place.eq(write_slot - age)
        slot = place + 2 * rows
        for rounds in range(1, least // rows - 2, -1):
            slot = Mux(place >= -rounds * rows, place + rounds * rows, slot)
        return slot

    lemma(write_slot < rows, "slots are those of the ring")
    lemma(registers["line_buffer.odd_slot"] == write_slot[0], "the row comes in at its slot's pair of banks")
    lemma(registers["line_buffer.base"] == (write_slot >> 1) * buffer.pitch, "the row comes in at its slot")

    lowest = buffer.window.d_lo - 1
    reading = proof.reading
    age = Signal(signed(proof.row_bits))
    m.d.comb += age.eq(proof.row_in - reading.base - reading.y - lowest)
    first, offset = registers["line_buffer.first"], registers["line_buffer.offset"]
    lemma(first == slot_of(age, least=min(0, -lowest)), "first is the slot of the lowest row")
    lemma(offset == (reading.y + lowest - first)[: len(offset)], "offset is the row that slot 0 stands for")

    _memory_lemmas(m, proof, lemma, slot_of)

    # Rows since the reset, until their numbers come round.
    rows_in = Signal(proof.row_bits)
    with m.If(proof.capture.row_written & ~rows_in.all()):
        m.d.sync += rows_in.eq(rows_in + 1)
    lemma(rows_in.all() | (rows_in == proof.row_in), "rows are numbered from the reset on")
    for base, name in ((base_out, "goes out"), (reading.base, "is read"), (proof.fetching.base, "is fetched")):
        lemma(rows_in.all() | (base <= proof.row_in), f"the frame that {name} came in after the reset")
    lemma(
        proof.present | proof.missing | (proof.row == proof.row_in) | ~(rows_in.all() | (proof.row < proof.row_in)),
        "every row that came in has the watched pixel or lacks it",
    )


def _pipeline_lemmas(m, proof, lemma, x_out, y_out, base_out):
    """Of the positions between raster and memories: they are in the raster's row or in the one before."""
    way, reading, fetching, height = proof.on_the_way, proof.reading, proof.fetching, proof.height

    def has_rows(base, y):
        since = Signal(proof.row_bits)
        m.d.comb += since.eq(proof.row_in - base)
        return (since >= height) | (since > y + proof.window.lead)

    def same_or_before(y, base, other_y, other_base, before):
        """Whether (y, base) is the same row as the other, or, if so asked, the row before."""
        first = other_y == 0
        return (y == Mux(before, Mux(first, height - 1, other_y - 1), other_y)) & (
            base == (other_base - Mux(before & first, height, 0))[: proof.row_bits]
        )

    clocks = len(way.ends)
    if clocks:
        lemma(proof.core.registers["row_end"] == way.ends, "row ends travel with positions")
        lemma(
            (proof.core.registers["frame_end"] & way.ends) == Mux(y_out == 0, way.ends, 0),
            "frame ends travel with positions",
        )
    ends = Cat(way.ends, fetching.ends)
    lemma((ends & (ends - 1)[: len(ends)]) == 0, "no two rows end within the pipeline")
    for stage in range(clocks):
        lemma(~ends[stage] | (x_out <= stage), f"a row is longer than the pipeline, {stage}")
        lemma(
            ~way.valid[stage] | ends[: stage + 1].any() | (x_out != 0),
            f"positions are in a row that has begun, {stage}",
        )
    lemma(~fetching.ends | (x_out <= clocks), "a row is longer than the pipeline")
    behind = way.ends.any() if clocks else Const(0)
    lemma(same_or_before(reading.y, reading.base, y_out, base_out, behind), "reading is in the raster's row or behind")
    lemma(
        same_or_before(fetching.y, fetching.base, reading.y, reading.base, fetching.ends),
        "fetching is in reading's row or behind",
    )
    lemma((x_out == 0) | has_rows(base_out, y_out), "a row that has begun has its source rows")
    lemma(~behind | has_rows(reading.base, reading.y), "a row that is ending has its source rows")
    lemma(~fetching.valid | has_rows(fetching.base, fetching.y), "what is fetched has its source rows")


def _memory_lemmas(m, proof, lemma, slot_of):
    """Of the stage between the coordinates and the memories, and of the watched pixel's place."""
    registers = proof.core.registers
    buffer, f = proof.parameters.line_buffer, proof.parameters.datapath.fraction_bits
    position = proof.fetching

    lemma(proof.in_window(position), "windows are as the core was built for")
    is_read = position.valid
    whole = {}
    for axis, name, coordinate, size in (
        ("x", "column", position.u, proof.width),
        ("y", "row", position.v, proof.height),
    ):
        whole[axis] = coordinate >> f
        inside = [(whole[axis] >= -tap) & (whole[axis] < size - tap) for tap in range(2)]
        fraction = coordinate[:f]
        if proof.replicated:
            whole[axis] = proof.clamped(whole[axis], size)
            fraction = Mux((coordinate >= 0) & (coordinate < (size - 1) << f), fraction, 0)
            inside = [1, 1]
        lemma(~position.valid | (registers[f"line_buffer.{name}_inside"] == Cat(inside)), f"which {name}s are inside")
        is_read = is_read & (inside[0] | inside[1])
        lemma(~position.valid | (registers[f"line_buffer.fraction_{axis}"] == fraction), f"the {name}'s fraction")
    column, slot = registers["line_buffer.column"], registers["line_buffer.slot"]
    lemma(~position.valid | (column == whole["x"][: len(column)]), "the column")
    age = Signal(proof.row_bits)
    m.d.comb += age.eq(proof.row_in - position.base - whole["y"])
    lemma(~is_read | (slot == slot_of(age)), "the slot is the one in which the row came in")

    age = Signal(proof.row_bits)
    m.d.comb += age.eq(proof.row_in - proof.row)
    slot = Signal.like(slot)
    m.d.comb += slot.eq(slot_of(age))
    stored = []
    for row in range(2):
        for column in range(2):
            watches = [memory.watch for memory in proof.core.bank(row, column)]
            for watch in watches:
                m.d.comb += watch.addr.eq((slot >> 1) * (buffer.pitch * buffer.granule) + (proof.column >> 1))
            stored.append(Cat(watch.data for watch in watches))
    is_kept = (age < buffer.rows) | ((age == buffer.rows) & (registers["capture.x"] == 0))
    lemma(~proof.present | (proof.column < proof.width), "only pixels of the source come in")
    lemma(
        ~(proof.present & is_kept)
        | (Array(stored)[Cat(proof.column[0], slot[0])] == proof.tag(proof.column, proof.row)),
        "the watched pixel is in its place until its slot's next row comes in",
    )


def frames_lemmas(m, proof):
    """Add the lemmas of a `FramesProof` to its module."""
    registers, width, height = proof.core.registers, proof.width, proof.height
    lead, stages = proof.parameters.line_buffer.window.lead, proof.parameters.pipeline_latency
    datapath, capture = proof.core.parts["datapath"], proof.core.parts["capture"]

    def lemma(fact, name):
        m.d.comb += Assert(fact, f"lemma: {name}")

    y_in, in_frame, complete = registers["capture.y"], registers["capture.in_frame"], registers["flow.complete"]
    x_out, y_out = issued_position(m, proof.core)
    ahead, warmed = registers["flow.ahead"], Signal(range(proof.parameters.datapath.warm_up + 1))
    m.d.comb += warmed.eq(proof.parameters.datapath.warm_up - proof.core.warming)
    number_out = y_out * width + x_out
    lemma(y_in < height, "capture counts its rows")
    lemma(in_frame | ((y_in == 0) & (capture.x == 0)), "capture waits for a frame's first beat")
    lemma(
        (ahead == y_in - y_out + Mux(complete, height, 0)) & (ahead <= lead + 2),
        "flow counts how far the input is ahead",
    )

    # The positions in the pipeline; where there is none, the next one to come.
    before = proof.core.issue, x_out, y_out
    ends, own_ends, own = [], [], proof.core.issue & datapath.end_of_frame & proof.waits_for_issue
    for stage in range(stages):
        valid, own_end = Signal(name=f"valid_{stage}"), Signal(name=f"own_end_{stage}")
        x, y = Signal(range(width), name=f"x_{stage}"), Signal(range(height), name=f"y_{stage}")
        with m.If(datapath.enable):
            m.d.sync += [valid.eq(before[0]), x.eq(before[1]), y.eq(before[2]), own_end.eq(own)]
        last_column, last_row = x == width - 1, y == height - 1
        ends.append(valid & last_column & last_row)
        own_ends.append(own_end)
        lemma((x < width) & (y < height), f"positions are in the frame, {stage}")
        lemma(registers["valid"][stage] == valid, f"tvalid travels with positions, {stage}")
        lemma(
            ~valid | (registers["start_of_frame"][stage] == ((x == 0) & (y == 0))),
            f"tuser travels with positions, {stage}",
        )
        lemma(~valid | (registers["end_of_line"][stage] == last_column), f"tlast travels with positions, {stage}")
        lemma(before[1] == Mux(valid, Mux(last_column, 0, x + 1), x), f"columns follow each other, {stage}")
        lemma(before[2] == Mux(valid & last_column, Mux(last_row, 0, y + 1), y), f"rows follow each other, {stage}")
        lemma(~ends[-1] | (number_out <= stage), f"a frame is longer than the pipeline, {stage}")
        before, own = (valid, x, y), own_end
    lemma((proof.out.x == before[1]) & (proof.out.y == before[2]), "the output is in step with the positions")

    ends, own_ends = Cat(ends), Cat(own_ends)
    in_pipeline = ends.any()
    lemma((ends & (ends - 1)[:stages]) == 0, "no two frames end within the pipeline")
    lemma(proof.owed == in_pipeline + complete, "frames wait to be issued or are in the pipeline")

    # The chosen frame: its positions are being issued, or its last one is in the pipeline.
    lemma(proof.chosen | ((proof.left == 0) & (proof.clocks == 0)), "before a frame is chosen none is counted")
    lemma((proof.left != 0) == (proof.waits_for_issue | own_ends.any()), "the chosen frame is somewhere")
    lemma(~proof.waits_for_issue | ~own_ends.any(), "the chosen frame is in one place")
    lemma((own_ends & ~ends) == 0, "the chosen frame's end is a frame's end")
    lemma(
        ~proof.waits_for_issue | (complete & (proof.clocks <= number_out + warmed) & (proof.left == in_pipeline + 1)),
        "the chosen frame is issued without a pause",
    )
    for stage in range(stages):
        lemma(
            ~own_ends[stage]
            | ((proof.clocks <= width * height + stage + proof.parameters.datapath.warm_up) & (proof.left == 1)),
            f"the chosen frame's end moves on, {stage}",
        )

    lines = proof.declared * (width + 1)
    lemma(proof.declared <= Mux(in_frame, y_in, height), "only missing lines are declared")
    lemma(
        proof.waited <= lines + Mux(capture.may_write, width, x_out) + warmed,
        "a beat waits for the output's row, or for missing lines",
    )
