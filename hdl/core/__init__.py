"""A finished core: its Verilog and its plan."""
