"""Simulation: frames through exported cores, integer models, a rendered scene."""

import hdl as hdl  # first of all, for what it does about interruptions
