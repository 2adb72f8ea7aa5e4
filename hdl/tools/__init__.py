"""Programs that are called: Yosys, to write Verilog, to read it and to synthesise it."""
