"""Stereo rectification cores: from a calibration file to Verilog."""

import os

# Amaranth prefers any Yosys on the PATH over the one it is pinned with; another version writes other Verilog.
os.environ["AMARANTH_USE_YOSYS"] = "builtin"
