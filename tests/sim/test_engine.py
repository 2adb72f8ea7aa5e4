import numpy as np
import pytest
from amaranth.back import verilog
from axi_blocks import PORTS, WIRE, Fifo, Slice, Tally, assert_same, stream

from sim.beats import BEAT, StreamError, to_beats, to_frames
from sim.compiler import compile_core
from sim.engine import Status, Violation


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cores")


@pytest.fixture(scope="module")
def build(cache):
    def compiled(block):
        return compile_core(verilog.convert(block, name="block", emit_src=False), "block", cache=cache)

    return compiled


@pytest.fixture(scope="module")
def fifo(build):
    return build(Fifo())


@pytest.fixture(scope="module")
def wire(cache):
    return compile_core(WIRE, "block", cache=cache)


@pytest.fixture(scope="module", params=["slice", "fifo"])
def sound(request, build, fifo):
    return fifo if request.param == "fifo" else build(Slice())


@pytest.mark.parametrize("burst", [None, 40.0])
@pytest.mark.parametrize("backpressure", [0, 0.3, 0.9])
@pytest.mark.parametrize("idle", [0, 0.3, 0.9])
def test_beats_pass_unchanged(sound, idle, backpressure, burst):
    beats = stream(5000, sound.in_bits)
    run = sound.run(beats, idle=idle, backpressure=backpressure, burst=burst, seed=3)
    assert_same(run.beats, beats)
    assert_same(run.sent, beats)
    assert run.status is Status.DONE
    assert run.violations == 0 and run.first_violation is None
    assert (run.beats["cycle"] > run.sent["cycle"]).all()
    if backpressure == 0:
        assert run.stall_cycles == run.not_ready_cycles == 0


def test_without_pauses_a_beat_moves_every_cycle(sound):
    run = sound.run(stream(1000), settle=10)
    latency = run.beats["cycle"] - run.sent["cycle"]
    np.testing.assert_array_equal(run.sent["cycle"], np.arange(1000))
    assert (latency == latency[0]).all()
    assert run.cycles == 1000 + latency[0] + 10
    assert run.stall_cycles == run.not_ready_cycles == 0


def test_pauses_take_their_share_of_the_cycles(wire):
    for burst in (None, 20.0):
        idle = wire.run(stream(50_000), idle=0.4, burst=burst)
        stop = wire.run(stream(50_000), backpressure=0.4, burst=burst)
        assert idle.stall_cycles == 0
        assert stop.stall_cycles == pytest.approx(0.4 * stop.cycles, rel=0.05)
        for run in (idle, stop):
            assert len(run.beats) == pytest.approx(0.6 * run.cycles, rel=0.05)
            pauses = np.diff(run.beats["cycle"])
            assert (pauses[pauses > 1] - 1).mean() == pytest.approx(burst or 1 / 0.6, rel=0.1)


def test_a_seed_repeats_its_run_and_another_does_not(wire):
    first, again, other = (wire.run(stream(500), idle=0.5, backpressure=0.5, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.beats, again.beats)
    assert (first.beats["cycle"] != other.beats["cycle"]).any()


def test_blanking_is_kept_to_the_cycle(wire):
    run = wire.run(to_beats(np.zeros((2, 3, 4), np.uint8), line_gap=7, frame_gap=20))
    steps = np.diff(run.sent["cycle"]) - 1
    np.testing.assert_array_equal(np.flatnonzero(steps), [3, 7, 11, 15, 19])
    np.testing.assert_array_equal(steps[3::4], [7, 7, 20, 7, 7])


def test_blanking_longer_than_the_watchdog_is_no_hang(wire):
    assert wire.run(to_beats(np.zeros((2, 2), np.uint8), line_gap=500), watchdog=50).status is Status.DONE


@pytest.mark.parametrize(
    "fault, kind",
    [
        ("changes while waiting", Violation.BEAT_CHANGED),
        ("takes valid back", Violation.VALID_DROPPED),
        ("valid in reset", Violation.VALID_IN_RESET),
    ],
)
def test_broken_rule_of_m_axis_is_reported(build, fault, kind):
    core = build(Slice(fault))
    with pytest.raises(StreamError, match=f"cycles break {kind.name} on m_axis"):
        core.run(stream(200), backpressure=0.5)
    run = core.run(stream(200), backpressure=0.5, check=False)
    assert run.kinds == kind and run.violations > 0 and run.first_violation is not None
    if kind is not Violation.VALID_IN_RESET:
        assert core.run(stream(200), check=False).violations == 0


def test_beats_lost_under_backpressure_are_missed(build):
    core, beats = build(Fifo(drops=True)), stream(500, 24)
    assert_same(core.run(beats).beats, beats)
    with pytest.raises(StreamError, match=r"^no beat moved for 300 cycles \(500 of 500 beats in, \d+ of 500 out"):
        core.run(beats, backpressure=0.5, watchdog=300)


@pytest.mark.parametrize("pauses", [{}, {"idle": 0.9}, {"backpressure": 0.9}])
def test_watchdog_ends_a_hang(build, pauses):
    core = build(Slice("hangs"))
    with pytest.raises(StreamError) as error:
        core.run(stream(80), watchdog=100, **pauses)
    assert str(error.value).startswith("no beat moved for 100 cycles (50 of 80 beats in, 50 of 80 out")
    run = core.run(stream(80), watchdog=100, check=False, **pauses)
    assert run.status is Status.HANG and len(run.sent) == len(run.beats) == 50
    with pytest.raises(ValueError, match="no complete run to go on from"):
        core.run(stream(1), start="continue")


def test_surplus_beats_are_refused(build):
    core, frame = build(Slice("repeats the last")), np.zeros((3, 5), np.uint8)
    with pytest.raises(StreamError, match=r"^more beats than expected \(15 of 15 beats in, 16 of 15 out"):
        core.run(frame)
    assert core.run(frame, check=False).status is Status.DONE
    assert core.run(frame, expected=0, settle=3, check=False).status is Status.FULL


def test_state_lasts_as_long_as_it_is_asked_to(build):
    core = build(Tally())

    def counts(start):
        run = core.run(stream(3), start=start)
        return [(int(data) & 15, int(data) >> 4) for data in run.beats["data"]]

    assert counts("power-up") == [(0, 0), (1, 1), (2, 2)]
    assert counts("continue") == [(3, 3), (4, 4), (5, 5)]
    assert counts("reset") == [(0, 6), (1, 7), (2, 8)]
    assert counts("power-up") == [(0, 0), (1, 1), (2, 2)]


def test_frames_can_go_call_by_call(fifo):
    frames = np.random.default_rng(1).integers(0, 256, (3, 20, 30, 3), np.uint8)
    cycles = []
    for frame, start in zip(frames, ("power-up", "continue", "continue")):
        run = fifo.run(frame, idle=0.3, backpressure=0.3, start=start)
        np.testing.assert_array_equal(to_frames(run.beats, 30, 20, channels=3)[0], frame)
        cycles += [run.sent["cycle"][0], run.beats["cycle"][-1]]
    assert cycles == sorted(cycles)


def test_vga_frame_takes_a_fraction_of_a_second(fifo):
    frames = np.random.default_rng(2).integers(0, 256, (2, 480, 640), np.uint8)
    run = fifo.run(frames, idle=0.1, backpressure=0.1)
    np.testing.assert_array_equal(to_frames(run.beats, 640, 480), frames)


def test_registers_on_the_falling_edge_are_seen(cache):
    text = (
        PORTS
        + """\
  reg valid = 0; reg [9:0] rise = 0, fall = 0;
  wire go = ~valid | m_axis_tready;
  assign s_axis_tready = go, m_axis_tvalid = valid;
  assign {m_axis_tlast, m_axis_tuser, m_axis_tdata} = ~fall;
  always @(posedge aclk) if (~aresetn) valid <= 0; else if (go) begin
    valid <= s_axis_tvalid; rise <= ~{s_axis_tlast, s_axis_tuser, s_axis_tdata};
  end
  always @(negedge aclk) fall <= rise;
endmodule
"""
    )
    beats = stream(1000)
    run = compile_core(text, "block", cache=cache).run(beats, idle=0.3, backpressure=0.3)
    assert_same(run.beats, beats)


def test_arguments_out_of_range_are_named(wire):
    for arguments, message in [
        ({"idle": 1.0}, "idle = 1.0: not in 0 <= idle < 1"),
        ({"backpressure": -0.1}, "backpressure = -0.1: not in 0 <= backpressure < 1"),
        ({"idle": 0.9, "burst": 2.0}, "burst = 2.0: pauses of that length cannot fill 0.9 of the cycles"),
        ({"start": "again"}, "start = 'again': not power-up, reset or continue"),
        ({"reset_cycles": 1}, "reset_cycles = 1: not 2 or more"),
    ]:
        with pytest.raises(ValueError) as error:
            wire.run(stream(4), **arguments)
        assert str(error.value) == message
    with pytest.raises(ValueError, match="^tdata of 0x1ff: s_axis_tdata has 8 bits$"):
        wire.run(np.array([(0x1FF, 0, 0, False, False)], BEAT))
