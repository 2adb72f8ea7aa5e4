"""Cores of several datapaths for one rig, compiled for simulation; what is the same is made once."""

import os
from concurrent.futures import ThreadPoolExecutor
from itertools import product

import numpy as np

from hdl.calibration import SIDES
from hdl.core.build import Options, build
from hdl.datapaths import DATAPATHS
from hdl.errors import InputError
from hdl.geometry.rectification import rectify
from sim.compiler import compile_core


class Cores:
    """Compiled cores, each made once.

    Members
    -------
    refusals : list of str
        Datapaths that were left out, and why.
    """

    def __init__(self, progress):
        self._progress = progress
        self._made = {}
        self.refusals = []

    def of(self, rig, lens, names):
        """{datapaths with the same coordinates: {side: (Core, compiled)}}, for ``rig`` with or without the lens."""
        groups = {}
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            for name in names:
                pair = {side: self._core(rig, side, lens, name) for side in SIDES}
                if None in pair.values():
                    continue
                for others, same in groups.items():
                    if all(_same(pair[side], same[side]) for side in SIDES):
                        groups[*others, name] = groups.pop(others)
                        break
                else:
                    groups[(name,)] = pair
            keys = sorted(groups, key=lambda names: list(DATAPATHS).index(names[0]))
            compiled = {
                (key, side): pool.submit(self._compiled, groups[key][side]) for key, side in product(keys, SIDES)
            }
            return {key: {side: (groups[key][side], compiled[key, side].result()) for side in SIDES} for key in keys}

    def _core(self, rig, side, lens, name):
        key = rig.source, rig.width, side, lens, name
        if key not in self._made:
            self._progress(f"{name}{', lens' if lens else ''}, {side} camera")
            try:
                self._made[key] = build(rectify(rig, lens=lens)[side], Options(name), f"rectify_{side}")
            except InputError as refusal:
                self._made[key] = None
                self.refusals.append(f"Left out: {name}{', lens' if lens else ''}, {side}: {refusal}")
        return self._made[key]

    def _compiled(self, core):
        return compile_core(core.verilog, core.plan.top)


def _same(core, other):
    one, two = (made.parameters.datapath.coordinates for made in (core, other))
    return np.array_equal(one.u, two.u) and np.array_equal(one.v, two.v)
