"""A page about the cores in a folder: how exact they are, what they cost, and what they do to a pair of images."""
