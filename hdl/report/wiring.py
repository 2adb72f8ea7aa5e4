"""An example of how the cores are instantiated: a Verilog module around one or both of them."""

from hdl.report.figures import ports

_STREAMS = {"s": "camera", "m": "rectified"}
NAME = "stereo_rectifier"


def example(planned):
    """Verilog-2001 of a module `NAME` with one instance of each core; ``planned``: {side: PlannedCore}."""
    declarations, instances = ["    input wire aclk", "    input wire aresetn"], []
    for side, core in planned.items():
        connections = []
        for name, direction, bits in ports(core):
            if name in ("aclk", "aresetn"):
                outside = name
            else:
                outside = f"{side}_{_STREAMS[name[0]]}{name[len('s_axis') :]}"
                width = f"[{bits - 1}:0] " if bits > 1 else ""
                declarations.append(f"    {direction} wire {width}{outside}")
            connections.append(f"        .{name}({outside})")
        instances.append(f"    {core.plan.top} {side} (\n" + ",\n".join(connections) + "\n    );\n")
    return f"module {NAME} (\n" + ",\n".join(declarations) + "\n);\n" + "".join(instances) + "endmodule\n"
