import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from axi_blocks import PORTS, WIRE, WIRES, assert_same, stream

from sim import compiler
from sim.compiler import CompileError, compile_core


def test_a_cached_core_is_not_built_again(tmp_path, monkeypatch):
    path, cache = tmp_path / "block.v", tmp_path / "new" / "cache"
    path.write_text(WIRE)
    first = compile_core(path, "block", cache=cache)
    assert not first.cached
    assert list(cache.iterdir()) == [first.library]

    def refuse(*arguments, **_):
        raise AssertionError("a process was started")

    monkeypatch.setattr(compiler.subprocess, "run", refuse)
    again = compile_core(WIRE, "block", cache=cache)
    assert again.cached and again.library == first.library
    assert_same(again.run(stream(10)).beats, stream(10))
    with pytest.raises(AssertionError, match="a process was started"):
        compile_core(WIRE + "// another text\n", "block", cache=cache)


@pytest.mark.parametrize("share", [0, 0.9])
def test_a_cached_core_that_was_cut_off_is_built_again(tmp_path, share):
    cache = tmp_path / "cache"
    content = compile_core(WIRE, "block", cache=cache).library.read_bytes()
    (library,) = cache.iterdir()
    (tmp_path / "cut").write_bytes(content[: int(share * len(content))])
    os.replace(tmp_path / "cut", library)  # another file: the first is in use
    again = compile_core(WIRE, "block", cache=cache)
    assert not again.cached
    assert_same(again.run(stream(10)).beats, stream(10))
    assert compile_core(WIRE, "block", cache=cache).cached


def test_two_processes_can_build_the_same_core_at_once(tmp_path):
    (tmp_path / "block.v").write_text(WIRE)
    program = (
        "from sim.compiler import compile_core; import numpy as np; core = compile_core({!r}, 'block', cache={!r});"
        "print(len(core.run(np.zeros((4, 5), np.uint8)).beats))"
    ).format(str(tmp_path / "block.v"), str(tmp_path / "cache"))
    root = Path(compiler.__file__).parent.parent
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
    monkeypatch.setattr(compiler.shutil, "which", {"clang++": "/opt/clang++"}.get)
    assert compiler._compiler(None) == ("/opt/clang++",)
    monkeypatch.setattr(compiler.shutil, "which", {}.get)
    monkeypatch.setattr(compiler.importlib.util, "find_spec", lambda name: name)
    assert compiler._compiler(None) == (sys.executable, "-m", "ziglang", "c++", "-mcpu=baseline")
    monkeypatch.setattr(compiler.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(CompileError, match="^no C\\+\\+ compiler: set CXX, or install"):
        compile_core(WIRE, "block", cache=tmp_path)


def test_compiler_errors_are_passed_on(tmp_path):
    command = compiler._compiler(None)
    with pytest.raises(CompileError, match=r"error.*no_such_header.* \(log: .*\.log\)$"):
        compile_core(WIRE, "block", cache=tmp_path, compiler=shlex.join([*command, "-include", "no_such_header.h"]))


@pytest.mark.parametrize(
    "name, said, problem",
    [
        ("cxx", "error: out of order\nask again", "error: out of order"),
        ("cxx", "no cache", "no cache"),
        ("ziglang", "error: no global cache", "error: no global cache; set ZIG_GLOBAL_CACHE_DIR to another folder"),
    ],
)
def test_a_compiler_that_does_not_start_is_quoted(tmp_path, name, said, problem):
    command = [sys.executable, "-c", f"import sys; sys.exit({said!r})", name]
    with pytest.raises(CompileError) as error:
        compile_core(WIRE, "block", cache=tmp_path, compiler=shlex.join(command))
    assert str(error.value) == f"C++ compiler {shlex.join(command)}: {problem}"
