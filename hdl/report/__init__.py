"""A page about the cores in a folder: how exact they are, what they cost, and what they do to a pair of images."""

import logging

# Where matplotlib cannot keep its settings it says so in two lines; nothing is lost.
logging.getLogger("matplotlib").setLevel(logging.ERROR)
