import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from amaranth import ClockDomain, ClockSignal, Module, ResetSignal, Signal
from amaranth.back import verilog
from amaranth.lib import wiring
from amaranth.lib.fifo import SyncFIFOBuffered
from amaranth.lib.wiring import In, Out

import hdl  # noqa: F401  chooses Amaranth's Yosys
from sim import engine
from sim.beats import BEAT, StreamError, to_beats, to_frames
from sim.engine import CompileError, Status, Violation, compile_core


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


def stream(length, bits=8, seed=0):
    rng = np.random.default_rng(seed)
    beats = np.zeros(length, BEAT)
    beats["data"] = rng.integers(0, 1 << bits, length)
    beats["user"], beats["last"] = rng.integers(0, 2, (2, length))
    return beats


def assert_same(got, want):
    for field in ("data", "user", "last"):
        np.testing.assert_array_equal(got[field], want[field], err_msg=field)


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


def test_a_cached_core_is_not_built_again(tmp_path, monkeypatch):
    path, cache = tmp_path / "block.v", tmp_path / "new" / "cache"
    path.write_text(WIRE)
    first = compile_core(path, "block", cache=cache)
    assert not first.cached
    assert list(cache.iterdir()) == [first.library]

    def refuse(*arguments, **_):
        raise AssertionError("a process was started")

    monkeypatch.setattr(engine.subprocess, "run", refuse)
    again = compile_core(WIRE, "block", cache=cache)
    assert again.cached and again.library == first.library
    assert_same(again.run(stream(10)).beats, stream(10))
    with pytest.raises(AssertionError, match="a process was started"):
        compile_core(WIRE + "// another text\n", "block", cache=cache)


def test_two_processes_can_build_the_same_core_at_once(tmp_path):
    (tmp_path / "block.v").write_text(WIRE)
    program = (
        "from sim.engine import *; core = compile_core({!r}, 'block', cache={!r});"
        "print(len(core.run(np.zeros((4, 5), np.uint8)).beats))"
    ).format(str(tmp_path / "block.v"), str(tmp_path / "cache"))
    root = Path(engine.__file__).parent.parent
    builds = [subprocess.Popen([sys.executable, "-c", program], cwd=root, stdout=subprocess.PIPE) for _ in range(2)]
    assert [build.communicate()[0].split() for build in builds] == [[b"20"], [b"20"]]
    assert len(list((tmp_path / "cache").iterdir())) == 1


@pytest.mark.parametrize(
    "text, problem, warning",
    [
        (PORTS.replace(");", ")") + WIRES, "core.v:4: ERROR: syntax error, unexpected TOK_ASSIGN, expecting ';'", ""),
        (WIRE.replace("block", "other"), "ERROR: Module `block' not found!", ""),
        (
            WIRE.replace(", m_axis_tuser = s_axis_tuser", ""),
            "ERROR: Found 1 problems in 'check -assert'.",
            ": Warning: Wire block.\\m_axis_tuser is used but has no driver.",
        ),
        (
            WIRE.replace("= s_axis_tuser", "= m_axis_tlast ^ m_axis_tuser"),
            "ERROR: Found 1 problems in 'check -assert'.",
            ": Warning: found logic loop in module block:",
        ),
    ],
)
def test_refused_verilog_is_an_error_with_the_problem_and_the_log(tmp_path, text, problem, warning):
    with pytest.raises(CompileError) as error:
        compile_core(text, "block", cache=tmp_path)
    (log,) = tmp_path.iterdir()
    assert str(error.value) == f"Yosys: {problem} (log: {log}){warning}"
    assert problem in log.read_text()


@pytest.mark.parametrize(
    "old, new, message",
    [
        (", output m_axis_tlast", "", "block: m_axis_tlast is missing: expected output of at most 1 bits"),
        ("input aclk", "input aclk, input enable", "block: enable is input of 1 bits: expected no such port"),
        (
            "input s_axis_tuser",
            "input [1:0] s_axis_tuser",
            "block: s_axis_tuser is input of 2 bits: expected input of at most 1 bits",
        ),
        (
            "input m_axis_tready",
            "inout m_axis_tready",
            "block: m_axis_tready is inout of 1 bits: expected input of at most 1 bits",
        ),
        ("[7:0]", "[79:0]", "block: m_axis_tdata is output of 80 bits: expected output of at most 64 bits"),
    ],
)
def test_other_ports_are_refused_by_name(tmp_path, old, new, message):
    text = PORTS.replace(old, new) + WIRES + "endmodule\n"
    with pytest.raises(CompileError) as error:
        compile_core(text, "block", cache=tmp_path)
    assert str(error.value) == message


def test_compiler_is_the_named_one_then_cxx_then_those_installed(tmp_path, monkeypatch):
    monkeypatch.setenv("CXX", "no-such-cxx -O")
    with pytest.raises(CompileError, match="^C\\+\\+ compiler no-such-cxx -O: .*No such file"):
        compile_core(WIRE, "block", cache=tmp_path)
    with pytest.raises(CompileError, match="^C\\+\\+ compiler no-such-argument: .*No such file"):
        compile_core(WIRE, "block", cache=tmp_path, compiler="no-such-argument")
    monkeypatch.delenv("CXX")
    monkeypatch.setattr(engine.shutil, "which", {"clang++": "/opt/clang++"}.get)
    assert engine._compiler(None) == ("/opt/clang++",)
    monkeypatch.setattr(engine.shutil, "which", {}.get)
    monkeypatch.setattr(engine.importlib.util, "find_spec", lambda name: name)
    assert engine._compiler(None) == (sys.executable, "-m", "ziglang", "c++", "-mcpu=baseline")
    monkeypatch.setattr(engine.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(CompileError, match="^no C\\+\\+ compiler: set CXX, or install"):
        compile_core(WIRE, "block", cache=tmp_path)


def test_compiler_errors_are_passed_on(tmp_path):
    compiler = engine._compiler(None)
    with pytest.raises(CompileError, match=r"error.*no_such_header.* \(log: .*\.log\)$"):
        compile_core(WIRE, "block", cache=tmp_path, compiler=shlex.join([*compiler, "-include", "no_such_header.h"]))
