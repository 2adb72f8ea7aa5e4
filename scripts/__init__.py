"""What makes the tables and figures."""

import hdl as hdl  # first of all, for what it does about interruptions
