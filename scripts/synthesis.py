"""Resources of a core on a Xilinx 7-series FPGA, by Yosys."""

import hashlib
import json
import re
from dataclasses import astuple, dataclass
from pathlib import Path

from hdl import yosys


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

    def __add__(self, other):
        return Resources(*(a + b for a, b in zip(astuple(self), astuple(other))))


def conditions(dsp):
    """How `synthesise` measures, in words."""
    return f"Yosys {yosys.version().split('.post')[0]}, {_command('TOP', dsp)}"


def _command(top, dsp, flatten=True):
    return f"synth_xilinx -family xc7{' -flatten' if flatten else ''} -noiopad{'' if dsp else ' -nodsp'} -top {top}"


def synthesise(verilog, top, *, dsp=False, cache=Path("build/cache")):
    """`Resources` of the module ``top`` of a Verilog text; ``dsp`` allows multipliers in DSP blocks.

    Results are cached by content. Raises RuntimeError with Yosys's own error line and the log's path.
    """
    return Resources.count(_statistics(verilog, _command(top, dsp), cache)["design"]["num_cells_by_type"])


def synthesise_blocks(verilog, top, *, dsp=False, cache=Path("build/cache")):
    """`Resources` of each module of a Verilog text, by name, without those inside it, boundaries kept.

    Together they take more than the flattened core, as nothing is optimised across boundaries. Otherwise as
    `synthesise`.
    """
    modules = _statistics(verilog, _command(top, dsp, flatten=False), cache)["modules"]
    return {name.lstrip("\\"): Resources.count(module["num_cells_by_type"]) for name, module in modules.items()}


def _statistics(verilog, command, cache):
    """What Yosys's stat says after ``command``."""
    key = hashlib.sha256("\0".join((yosys.version(), command, verilog)).encode()).hexdigest()[:20]
    work = Path(cache) / f"synthesis-{key}"
    result = work / "statistics.json"
    if not result.exists():
        work.mkdir(parents=True, exist_ok=True)
        (work / "core.v").write_text(verilog, encoding="utf-8")
        yosys.run(f"read_verilog core.v; {command}; tee -q -o stat.json stat -json", work)
        (work / "stat.json").replace(result)
    return json.loads(result.read_text())
