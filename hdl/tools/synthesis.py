"""Resources of a core on a Xilinx 7-series FPGA, by Yosys."""

import hashlib
import json
import re
import tempfile
from dataclasses import astuple, dataclass
from pathlib import Path

from hdl.files import named
from hdl.tools import yosys

_BLOCK = re.MULTILINE | re.DOTALL


@dataclass(frozen=True)
class Resources:
    """Cells after synthesis.

    Members
    -------
    ff : int
        Flip-flops.
    lut : int
        All look-up tables: logic (inverters counted as one each), shift registers and distributed memory.
    srl, lut_ram : int
        The shift registers and the memory among them.
    carry4, dsp, ramb18, ramb36 : int
    """

    ff: int
    lut: int
    srl: int
    lut_ram: int
    carry4: int
    dsp: int
    ramb18: int
    ramb36: int

    @classmethod
    def count(cls, cells):
        """From cell names and their numbers."""

        def total(pattern):
            return sum(number for cell, number in cells.items() if re.fullmatch(pattern, cell))

        srl = total(r"SRL16E?|SRLC(16|32)E")
        lut_ram = 2 * total(r"RAM(32|64)X1D(_1)?|RAM128X1S.*") + 4 * total(r"RAM(32|64)M|RAM128X1D.*")
        return cls(
            ff=total(r"FD[RSCP]E(_1)?|LD[CP]E"),
            lut=total(r"LUT[1-6]|INV") + srl + lut_ram,
            srl=srl,
            lut_ram=lut_ram,
            carry4=total("CARRY4"),
            dsp=total("DSP48E1"),
            ramb18=total("RAMB18E1"),
            ramb36=total("RAMB36E1"),
        )

    def __sub__(self, other):
        return Resources(*(a - b for a, b in zip(astuple(self), astuple(other))))


def conditions(dsp):
    """How `synthesise` measures, in words."""
    return f"Yosys {yosys.version().split('.post')[0]}, {_command('TOP', dsp)}"


def _command(top, dsp):
    return f"synth_xilinx -family xc7 -flatten -noiopad{'' if dsp else ' -nodsp'} -top {top}"


def synthesise(verilog, top, *, dsp=False, cache=Path("build/cache")):
    """`Resources` of the module ``top`` of a Verilog text; ``dsp`` allows multipliers in DSP blocks.

    Results are cached by content; an entry that is damaged is made anew. Raises ToolError with Yosys's own error line
    and the log's path.
    """
    command = _command(top, dsp)
    key = hashlib.sha256("\0".join((yosys.version(), command, verilog)).encode()).hexdigest()[:20]
    result = Path(cache) / f"synthesis-{key}.json"
    cells = _cells(result)
    if cells is None:
        result.parent.mkdir(parents=True, exist_ok=True)
        with named(cache), tempfile.TemporaryDirectory(dir=cache, prefix=".synthesis-") as work:
            work = Path(work)
            (work / "core.v").write_text(verilog, encoding="utf-8")
            script = f"read_verilog core.v; {command}; tee -q -o stat.json stat -json"
            yosys.run(script, work, keep=result.with_suffix(".log"))
            cells = json.loads((work / "stat.json").read_text())["design"]["num_cells_by_type"]
            (work / "cells.json").write_text(json.dumps(cells))
            (work / "cells.json").replace(result)
    return Resources.count(cells)


def _cells(file):
    """The numbers of cells in a file of the cache; None where it is none."""
    try:
        cells = json.loads(file.read_text())
    except (OSError, ValueError):
        return None
    whole = isinstance(cells, dict) and all(isinstance(number, int) for number in cells.values())
    return cells if whole else None


def synthesise_block(verilog, module, *, dsp=False, cache=Path("build/cache")):
    """`Resources` of one module of an exported core, those inside it included, by itself; otherwise as `synthesise`.

    It is flattened into a module around it, as it is into the core: Yosys takes the operand of an addition for the
    carry chain that it finds declared first, and flattening turns the order round. Alone at the top the interpolator
    takes more.
    """
    modules = {found.group(1): found.group() for found in re.finditer(r"^module (\w+)\b.*?^endmodule", verilog, _BLOCK)}
    needed, rest = [], [module]
    while rest:
        needed.append(rest.pop())
        found = (name for name in modules if re.search(rf"^  {name} ", modules[needed[-1]], re.MULTILINE))
        rest += [name for name in found if name not in (*needed, *rest)]
    ports = re.search(r"\((.*?)\);", modules[module], re.DOTALL).group(1)
    names = [port.strip() for port in ports.split(",")]
    around = [
        f"module alone({ports});",
        *re.findall(r"^  (?:input|output) .*?;", modules[module], re.MULTILINE),
        f"  {module} inside({', '.join(f'.{name} ({name} )' for name in names)});",
        "endmodule",
    ]
    return synthesise("\n".join([*map(modules.get, needed), *around, ""]), "alone", dsp=dsp, cache=cache)
