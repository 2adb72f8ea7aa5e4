"""From a rig to the exact map of each rectified view."""
