"""Why frames drain: where the positions in the pipeline are, and the frame that was chosen; inductive."""

from amaranth import Cat, Mux, Signal

from hdl.stream.raster import NEAR

from .control import Control


class Beat:
    """A position in the pipeline, by its register's name; where there is none, the next one to come.

    Members: ``valid``, ``x`` and ``y``; ``own``, it ends the chosen frame.
    """

    def __init__(self, proof, stage):
        self.valid, self.own = Signal(name=f"{stage}_valid"), Signal(name=f"{stage}_own")
        self.x = Signal(range(proof.width), name=f"{stage}_x")
        self.y = Signal(range(proof.height), name=f"{stage}_y")
        self.is_last = self.x == proof.width - 1
        self.ends = self.valid & self.is_last & (self.y == proof.height - 1)

    def follow(self, other):
        """Statements that copy the other."""
        return [getattr(self, name).eq(getattr(other, name)) for name in ("valid", "own", "x", "y")]


def frames_lemmas(m, proof):
    """Add the lemmas of a `FramesProof` to its module."""
    registers, width, height, core = proof.core.registers, proof.width, proof.height, proof.core
    datapath, capture, ports = core.parts["datapath"], core.parts["capture"], proof.parameters.pipeline.ports
    stages = proof.parameters.pipeline_latency - ports
    control = Control(m, core)
    control.rows_agree()
    lemma, warm_up, stopped = control.lemma, proof.parameters.datapath.warm_up, control.stopped
    number_out = control.y * width + control.x

    # The positions in the pipeline, the newest first, and those at the output.
    issued = Beat(proof, "issued")
    m.d.comb += [
        issued.valid.eq(core.issue),
        issued.x.eq(control.x),
        issued.y.eq(control.y),
        issued.own.eq(core.issue & datapath.end_of_frame & proof.waits_for_issue & ~proof.waits_for_other),
    ]
    beats, marks = [Beat(proof, f"stage_{stage}") for stage in range(stages)], []
    for stage, (before, beat) in enumerate(zip([issued, *beats], beats)):
        with m.If(datapath.enable):
            m.d.sync += beat.follow(before)
        lemma(registers["valid"][stage] == beat.valid, f"tvalid travels with positions, {stage}")
        marks.append(Cat(registers["start_of_frame"][stage], registers["end_of_line"][stage]))
    if ports:
        last, latched, aside, out = beats[-1], Beat(proof, "latched"), Beat(proof, "aside"), Beat(proof, "out")
        with m.If(datapath.enable):
            m.d.sync += latched.follow(last)
        m.d.comb += aside.follow(last)
        m.d.comb += [aside.valid.eq(stopped), aside.own.eq(stopped & latched.own)]
        with m.If(stopped):
            m.d.comb += [aside.x.eq(latched.x), aside.y.eq(latched.y)]
        with m.If(~core.m_axis.valid | core.m_axis.ready):
            m.d.sync += out.follow(last)
            with m.If(stopped):
                m.d.sync += out.follow(aside)
        lemma(~stopped | latched.valid, "what stands aside is a beat")
        lemma(core.m_axis.valid == out.valid, "tvalid is the output's")
        beats += [aside, out]
        marks += [registers["skid.aside"][-2:], registers["skid.out"][-2:]]

    for stage, (before, beat, mark) in enumerate(zip([issued, *beats], beats, marks)):
        lemma((beat.x < width) & (beat.y < height), f"positions are in the frame, {stage}")
        lemma(~beat.own | beat.ends, f"the chosen frame's end is a frame's end, {stage}")
        lemma(
            ~beat.valid | (mark == Cat((beat.x == 0) & (beat.y == 0), beat.is_last)),
            f"tuser and tlast travel with positions, {stage}",
        )
        next_x = Mux(beat.is_last, 0, beat.x + 1)
        next_y = Mux(beat.is_last, Mux(beat.y == height - 1, 0, beat.y + 1), beat.y)
        lemma(before.x == Mux(beat.valid, next_x, beat.x), f"columns follow each other, {stage}")
        lemma(before.y == Mux(beat.valid, next_y, beat.y), f"rows follow each other, {stage}")
        lemma(~beat.ends | (number_out <= stage), f"a frame is longer than the pipeline, {stage}")
    end = beats[-1]
    out_x, out_y = (Mux(end.valid, here, before) for here, before in ((end.x, beats[-2].x), (end.y, beats[-2].y)))
    if not ports:
        out_x, out_y = end.x, end.y
    lemma((proof.out.x == out_x) & (proof.out.y == out_y), "the output is in step with the positions")

    ends, own = Cat(beat.ends for beat in beats), Cat(beat.own for beat in beats)
    lemma((ends & (ends - 1)[: len(ends)]) == 0, "no two frames end within the pipeline")
    lemma(proof.in_pipeline == ends.any(), "a frame whose end is in the pipeline is not yet out")
    issuing = control.early_frame
    lemma(proof.owed == ends.any() + issuing + control.complete, "frames wait to be issued or are in the pipeline")

    # The chosen frame: its positions are being issued, or its last one is in the pipeline.
    waits, other = proof.waits_for_issue, proof.waits_for_other
    lemma(proof.chosen | ((proof.left == 0) & (proof.clocks == 0)), "before a frame is chosen none is counted")
    lemma((proof.left != 0) == (waits | own.any()), "the chosen frame is somewhere")
    lemma(~waits | ~own.any(), "the chosen frame is in one place")
    lemma(~other | (waits & issuing & control.complete), "another frame is issued before")
    lemma(
        ~waits | ((issuing | control.complete) & (proof.left == ends.any() + other + 1)),
        "the chosen frame is the next but for others",
    )
    clocks, late = Signal(range(proof.drain_clocks + 2)), proof.late
    m.d.comb += clocks.eq(proof.clocks + stopped)
    if proof.parameters.pipeline.ahead:
        needs_all = late > 1
        lemma(~other | needs_all, "another frame is before only if the first row needs all rows but one")
        lemma(
            ~(waits & ~other) | control.permitted | (proof.clocks <= number_out + control.warmed),
            "the chosen frame waits for its permission",
        )
        lemma(~other | (clocks + width - NEAR <= control.x + 1), "the chosen frame waits for the end of the other")
    lemma(
        ~(waits & ~other & control.permitted) | (clocks <= number_out + control.warmed + late),
        "the chosen frame is issued without a pause",
    )
    for stage, beat in enumerate(beats):
        # At the output it no longer matters whether the pipeline stopped.
        at_output = ports and beat is end
        since = proof.clocks if at_output else clocks
        lemma(
            ~beat.own | ((since <= width * height + warm_up + late + stage - at_output) & (proof.left == 1)),
            f"the chosen frame's end moves on, {stage}",
        )

    lines, near = proof.declared * proof.line_clocks, NEAR * proof.parameters.pipeline.ahead
    moved = Mux(control.early, control.x + near - width, control.x + near) if near else control.x
    lemma(proof.declared <= Mux(control.in_frame, control.y_in, height), "only missing lines are declared")
    lemma(
        proof.waited + stopped
        <= lines + Mux(capture.may_write, proof.line_clocks - 1, moved) + control.warmed + (near > 0),
        "a beat waits for the output's row, or for missing lines",
    )
