"""Where the pipeline has registers at the ports, no port depends on another within a clock; by the netlist."""

import json

import cores
import pytest

from hdl.arithmetic.cuts import BALANCED, COMPACT, FAST
from hdl.stream.rectifier import Rectifier, RectifierParameters
from hdl.tools import verilog, yosys

S_AXIS, M_AXIS = (
    {f"{name}_t{part}" for part in ("data", "valid", "ready", "user", "last")} for name in ("s_axis", "m_axis")
)


class Netlist:
    """What depends on what within a clock, in a core's Verilog, flattened.

    Parameters
    ----------
    pipeline : Pipeline
    folder : Path
        Where to work.
    """

    def __init__(self, pipeline, folder):
        core = Rectifier(RectifierParameters(cores.parameters().datapath.with_pipeline(pipeline)))
        (folder / "core.v").write_text(verilog.convert(core, "core"))
        yosys.run("read_verilog core.v; prep -flatten -top core; memory_map; write_json core.json", folder)
        module = json.loads((folder / "core.json").read_text())["modules"]["core"]
        self.directions = {name: port["direction"] for name, port in module["ports"].items()}
        self._ports = {name: port["bits"] for name, port in module["ports"].items()}
        self._nets = {name: set(net["bits"]) for name, net in module["netnames"].items()}
        self._feeding, self._registers = {}, []
        for cell in module["cells"].values():
            ends = {"input": set(), "output": set()}
            for port, bits in cell["connections"].items():
                ends[cell["port_directions"][port]].update(bit for bit in bits if isinstance(bit, int))
            if "dff" in cell["type"]:
                self._registers.append((ends["output"], ends["input"]))
            else:
                for bit in ends["output"]:
                    self._feeding.setdefault(bit, set()).update(ends["input"])

    def ports_behind(self, port):
        """Names of the inputs that an output depends on."""
        return self._inputs(bit for bit in self._ports[port] if isinstance(bit, int))

    def registers_behind(self, port, block):
        """Bits of the registers whose next states depend on an input: all, and those that are in ``block``."""
        states = set().union(*(state for state, inputs in self._registers if port in self._inputs(inputs)))
        inside = set().union(*(bits for name, bits in self._nets.items() if name.startswith(f"{block}.")))
        return states, states & inside

    def _inputs(self, bits):
        seen, found = set(), set(bits)
        while found:
            seen |= found
            found = set().union(*(self._feeding.get(bit, ()) for bit in found)) - seen
        return {
            name
            for name, direction in self.directions.items()
            if direction == "input" and not seen.isdisjoint(self._ports[name])
        }


@pytest.fixture(scope="module", params=[COMPACT, BALANCED, FAST], ids=lambda pipeline: pipeline.name)
def core(request, tmp_path_factory):
    return request.param, Netlist(request.param, tmp_path_factory.mktemp("netlist"))


def test_outputs_are_fed_by_registers_only_but_for_tready_of_compact(core):
    pipeline, netlist = core
    depends = {name: netlist.ports_behind(name) for name, way in netlist.directions.items() if way == "output"}
    assert set(depends) == M_AXIS - {"m_axis_tready"} | {"s_axis_tready"}
    assert depends.pop("s_axis_tready") == (set() if pipeline.ports else {"s_axis_tvalid", "s_axis_tuser"})
    assert not any(depends.values())


@pytest.mark.parametrize(
    "block, names", [("input_register", S_AXIS - {"s_axis_tready"}), ("skid", {"m_axis_tready"})], ids=["input", "skid"]
)
def test_no_register_but_those_at_the_ports_waits_for_a_port_within_a_clock(core, block, names):
    pipeline, netlist = core
    for name in names:
        states, at_the_port = netlist.registers_behind(name, block)
        assert states
        assert (states == at_the_port) == pipeline.ports
