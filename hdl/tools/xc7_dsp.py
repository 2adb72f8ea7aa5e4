"""How long a DSP48E1 of an Artix-7 takes, by the registers in it: speed grade -1, slow corner, 1.0 V, ns.

Source: Project X-Ray's data base, prjxray-db, artix7/timings/DSP_L.sdf, which agrees with AMD DS181 where that has a
figure: without a register at the product 257 MHz, with all of them 464 MHz (here 457).
"""

# To P: from a pin or, its clock to output within, from a register.
_TO_P = {
    "A": 3.841, "B": 3.656, "C": 1.820, "PCIN": 1.518, "CARRYIN": 1.416, "OPMODE": 2.326, "ALUMODE": 2.098,
    "CARRYINSEL": 1.910, "INMODE": 3.923, "AREG": 4.009, "BREG": 3.813, "CREG": 2.291, "MREG": 2.305, "PREG": 0.434,
    "OPMODEREG": 2.231, "ALUMODEREG": 2.054, "CARRYINREG": 1.764, "CARRYINSELREG": 1.927, "INMODEREG": 4.111,
}  # fmt: skip
# Where there is an adder before the multiplier; where there is no multiplier.
_ADDED_BEFORE = {
    "A": 5.201, "D": 5.070, "INMODE": 5.283, "AREG": 5.368, "DREG": 5.320, "ADREG": 3.684, "INMODEREG": 5.470,
}  # fmt: skip
_NOT_MULTIPLIED = {"A": 2.077, "B": 2.057, "AREG": 2.215, "BREG": 2.191}
# How much later PCOUT is than P, and how much earlier than to P a value is at a register within: the same from
# wherever it comes.
_PCOUT = 0.195
_EARLIER = {"PREG": 0.119, "MREG": 1.913, "ADREG": 3.445}
# Setup of the registers that come first, of clock enables and resets.
_SETUP = {
    "A": 0.362, "B": 0.450, "C": 0.233, "D": 0.413, "OPMODE": 0.449, "ALUMODE": 0.246, "INMODE": 0.449,
    "CARRYIN": 0.299, "CARRYINSEL": 0.208,
}  # fmt: skip
_ENABLE, _RESET = 0.665, 0.686


class Dsp:
    """As `hdl.tools.xc7_cells.Cell`."""

    def __init__(self, cell):
        parameters = cell["parameters"]
        multiplies = parameters.get("USE_MULT", "MULTIPLY") != "NONE"
        adds = multiplies and parameters.get("USE_DPORT", "FALSE") == "TRUE"
        self._to_p = _TO_P | (_ADDED_BEFORE if adds else {}) | ({} if multiplies else _NOT_MULTIPLIED)
        # The registers that a value passes, if they are there, on its way from a port to P.
        factor = [*(["ADREG"] if adds else []), *(["MREG"] if multiplies else [])]
        product = ["MREG"] if multiplies else []
        ways = {"A": factor, "B": product, "C": [], "INMODE": factor, "OPMODE": [], "ALUMODE": [], "CARRYIN": [],
                "CARRYINSEL": [], **({"D": factor} if adds else {})}  # fmt: skip
        ways = {port: [f"{port}REG", *way, "PREG"] for port, way in ways.items()} | {"PCIN": ["PREG"]}
        self._ways = {
            port: [stage for stage in way if int(parameters.get(stage, "0"), 2)] for port, way in ways.items()
        }
        inner = {pair for way in self._ways.values() for pair in zip(way, way[1:])}
        #: The longest way between two registers in the cell.
        self.within = max((self._to_p[first] - _EARLIER[second] for first, second in inner), default=0.0)

    def launch(self, port):
        times = [self._to_p[way[-1]] for way in self._ways.values() if way]
        return max(times) + self._later(port) if times else None

    def setup(self, port):
        if port.startswith(("CE", "RST")):
            return _ENABLE if port.startswith("CE") else _RESET
        way = self._ways.get(port)
        if not way:
            return None
        return _SETUP[port] if way[0] == f"{port}REG" else self._to_p[port] - _EARLIER[way[0]]

    def through(self, source, index, target, to):
        if self._ways.get(source) != []:
            return None
        return self._to_p[source] + self._later(target)

    @staticmethod
    def _later(port):
        return _PCOUT if port == "PCOUT" else 0.0
