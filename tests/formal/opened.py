"""A component whose inside can be seen: for lemmas about its registers, and for probes on its parts' ports."""

from amaranth.hdl import DomainRenamer, Elaboratable, Fragment


class Opened(Elaboratable):
    """Elaborates a component, once; a design that has this as its submodule has that component.

    Parameters
    ----------
    component : Component

    Attributes
    ----------
    parts : dict of str to Elaboratable
        The component, path "", and what it consists of, by their paths: "line_buffer.bank".
    registers : dict of str to Signal
        By path and name: "flow.ahead".
    """

    def __init__(self, component):
        self.parts, self.registers = {}, {}
        self._fragment = Fragment.get(component, None)
        self._walk("", self._fragment)

    def elaborate(self, platform):
        # Amaranth 0.5 does not take a local domain inside a design that has one of the same name.
        if "sync" in self._fragment.domains:
            return DomainRenamer({"sync": "inside"})(self._fragment)
        return self._fragment

    def _walk(self, path, fragment):
        self.parts[path.rstrip(".")] = fragment.origins[0] if fragment.origins else fragment
        for domain, statements in fragment.statements.items():
            for statement in statements if domain != "comb" else ():
                for signal in statement._lhs_signals():
                    self.registers[path + signal.name] = signal
        for part, name, _ in fragment.subfragments:
            self._walk(f"{path}{name}.", part)
