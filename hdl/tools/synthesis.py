"""Resources of a core on a Xilinx 7-series FPGA, and netlists, by Yosys."""

import hashlib
import json
import re
import tempfile
from collections import Counter
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

    @classmethod
    def of(cls, netlist):
        """Of a `netlist`."""
        return cls.count(Counter(cell["type"] for cell in netlist["cells"].values()))

    def __sub__(self, other):
        return Resources(*(a - b for a, b in zip(astuple(self), astuple(other))))


def conditions(dsp):
    """How `synthesise` measures, in words."""
    return f"Yosys {yosys.version().split('.post')[0]}, {xc7('TOP', dsp)}"


def xc7(top, dsp):
    """The Yosys command that makes a netlist for a Xilinx 7-series FPGA, as whole cores are measured."""
    return f"synth_xilinx -family xc7 -flatten -noiopad{'' if dsp else ' -nodsp'} -top {top}"


def ecp5(top, dsp):
    """The one for a Lattice ECP5."""
    return f"synth_ecp5{'' if dsp else ' -nodsp'} -top {top}"


def synthesise(verilog, top, *, dsp=False, cache=Path("build/cache")):
    """`Resources` of the module ``top`` of a Verilog text; ``dsp`` allows multipliers in DSP blocks.

    Results are cached by content; an entry that is damaged is made anew. Raises ToolError with Yosys's own error line
    and the log's path.
    """

    def made(work):
        return _loaded(work / "stat.json")["design"]["num_cells_by_type"]

    statistics = "tee -q -o stat.json stat -json"
    return Resources.count(_cached("synthesis", verilog, xc7(top, dsp), statistics, cache, _counted, made))


def netlist(verilog, top, command, *, cache=Path("build/cache")):
    """The module ``top`` of a Verilog text after ``command``, as Yosys describes it in JSON.

    Parameters
    ----------
    verilog, top : str
    command : str
        `xc7`'s, `ecp5`'s or another that flattens the module.
    cache : Path
        As in `synthesise`.

    Returns
    -------
    dict
        "ports", "cells" and "netnames", a bit of a net by its number. A cell has its "type", its "parameters" and, by
        port, its "port_directions" and "connections".
    """

    def made(work):
        module = _loaded(work / "netlist.json")["modules"][top]
        for entry in (*module["cells"].values(), *module["netnames"].values()):
            entry["attributes"] = {}  # line numbers, for the most part: more than half of the text
        return module

    return _cached("netlist", verilog, command, "write_json netlist.json", cache, _connected, made)


def _cached(kind, verilog, command, output, cache, whole, made):
    """What ``made``, called with the folder in which ``command`` and ``output`` have run, gives; or has given before.

    ``whole``: whether what a file of the cache holds is that.
    """
    key = hashlib.sha256("\0".join((yosys.version(), command, verilog)).encode()).hexdigest()[:20]
    result = Path(cache) / f"{kind}-{key}.json"
    try:
        found = _loaded(result)
    except (OSError, ValueError):
        found = None
    if not whole(found):
        result.parent.mkdir(parents=True, exist_ok=True)
        with named(cache), tempfile.TemporaryDirectory(dir=cache, prefix=f".{kind}-") as work:
            work = Path(work)
            (work / "core.v").write_text(verilog, encoding="utf-8")
            yosys.run(f"read_verilog core.v; {command}; {output}", work, keep=result.with_suffix(".log"))
            found = made(work)
            (work / "result").write_text(json.dumps(found, separators=(",", ":")))
            (work / "result").replace(result)
    return found


def _loaded(file):
    return json.loads(file.read_text())


def _counted(cells):
    return isinstance(cells, dict) and all(isinstance(number, int) for number in cells.values())


def _connected(module):
    return isinstance(module, dict) and all(isinstance(module.get(name), dict) for name in ("ports", "cells"))


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
