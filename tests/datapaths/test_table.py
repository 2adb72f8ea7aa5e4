"""The table: exact but for rounding, refused where it is too large, and in files that tools read quickly."""

import re

import numpy as np
import pytest
import rigs
from datapath_runs import assert_same, run

from hdl import calibration
from hdl.arithmetic.cost import block_rams
from hdl.arithmetic.cuts import PIPELINES
from hdl.core.build import Options, build
from hdl.datapaths.selection import choose
from hdl.datapaths.table import MOST_ENTRIES, Table
from hdl.errors import InputError
from hdl.geometry.coordinates import Border, Coordinates
from hdl.geometry.rectification import RectificationOptions, rectify
from hdl.stream.rectifier import Rectifier, RectifierParameters
from hdl.tools.verilog import convert
from sim.beats import to_beats, to_frames
from sim.compiler import compile_core
from sim.drivers import pauses
from sim.remap import remap


def view(size=(64, 48), lens=True, **options):
    return rectify(calibration.embedded(size), RectificationOptions(**options), lens=lens)["left"]


@pytest.mark.parametrize("rig", ["samples", "samples_whole", "toed_in", "looks_up"])
@pytest.mark.parametrize("fraction_bits", [3, 5, 8])
def test_every_coordinate_is_the_exact_one_rounded(rig, fraction_bits):
    exact = rigs.view(rig, "left", 31, 22)
    table = Table.fit(exact, fraction_bits)
    for used, w, size in zip((table.coordinates.u, table.coordinates.v), exact.map(), (31, 22)):
        near = (w > -1) & (w < size)
        np.testing.assert_array_equal(used[near], np.floor(w * 2**fraction_bits + 0.5)[near])
        assert set(np.unique(used[~near])) <= {-1 << fraction_bits, size << fraction_bits}


@pytest.mark.parametrize("border", [Border("constant", 90), Border("replicate")], ids=lambda border: border.mode)
def test_what_is_far_outside_looks_as_if_it_were_just_outside(border):
    exact = rigs.view("looks_up", "left", 40, 32)
    assert min(w.min() for w in exact.map()) < -5
    used = Table.fit(exact, 5).coordinates
    u, v = (np.floor(w * 32 + 0.5).astype(np.int32) for w in exact.map())
    frame = np.random.default_rng(2).integers(0, 256, (32, 40), np.uint8)
    rectified = [remap(frame, *pair, 5, border.mode, border.value) for pair in ((used.u, used.v), (u, v))]
    np.testing.assert_array_equal(*rectified)


def test_what_is_stored_takes_the_fewest_bits():
    narrow, wide = Table.fit(view(), 5), Table.fit(rigs.view("toed_in", "left", 64, 48), 5)
    # The embedded rig's rows and columns stay near their places, those of cameras that are far turned do not.
    assert list(narrow.formats) == ["u_less_column", "v_less_row"]
    for table in (narrow, wide):
        for (name, values), q in zip(table.stored.values(), table.formats.values()):
            used = table.coordinates.u if name.startswith("u") else table.coordinates.v
            assert rigs.fits(q, values)
            assert q.width <= max(used.max().item().bit_length(), (~used.min()).item().bit_length()) + 1
        assert table.memory_bits == 64 * 48 * sum(q.width for q in table.formats.values())
    assert narrow.entry_bits < sum(q.width for q in narrow.coordinate_formats)


@pytest.mark.parametrize("stored", [["u", "v"], ["u_less_column", "v"], ["u", "v_less_row"]])
def test_hardware_computes_the_coordinates_however_they_are_stored(stored):
    x, y = np.meshgrid(np.arange(40), np.arange(36))
    random = np.random.default_rng(5).integers(-20, 20, (2, 36, 40))
    u = np.where("u" in stored, random[0] % 40 * 32, x * 32 + random[0])
    v = np.where("v" in stored, 50 + abs(random[1]), y * 32 + random[1])
    table = Table(40, 36, 5, Coordinates(u.astype(np.int32), v.astype(np.int32), 5))
    assert list(table.formats) == stored
    core = compile_core(convert(Rectifier(RectifierParameters(table)), "t"), "t")
    frames = np.random.default_rng(6).integers(0, 256, (2, 36, 40), np.uint8)
    beats = core.run(to_beats(frames), idle=0.2, backpressure=0.3, seed=4).beats
    for frame, out in zip(frames, to_frames(beats, 40, 36), strict=True):
        np.testing.assert_array_equal(out, remap(frame, table.coordinates.u, table.coordinates.v, 5, "constant", 0))


@pytest.mark.parametrize("pipeline", PIPELINES.values(), ids=PIPELINES)
@pytest.mark.parametrize("rig", ["samples", "toed_in"])
def test_a_register_is_only_where_something_is_added_to_what_is_stored(rig, pipeline):
    table = Table.fit(rigs.view(rig, "left", 24, 18), 5).with_pipeline(pipeline)
    adds = not {"u", "v"} >= table.formats.keys()
    assert table.latency == 2 + (adds and pipeline.taps)
    assert_same(run(table, 2, pauses(0.2, seed=1), pauses(0.2, seed=2)), table)


def test_memory_is_stated():
    table = Table.fit(view((160, 120)), 5)
    assert table.entries == 160 * 120
    # No fewer block RAMs than the bits need, at 18 Kbit each.
    assert table.cost.ramb18 == block_rams(table.entries, table.entry_bits) >= table.memory_bits / 18432


def test_large_frames_are_refused_with_the_memory_they_would_take():
    with pytest.raises(InputError) as caught:
        Table.fit(view((640, 480), lens=False), 5)
    assert str(caught.value) == (
        "--size: 640x480: a table has 307200 entries of 21 bits, 6.5 Mbit; more than 65536 entries are not built"
    )


def test_the_choice_of_datapaths_lists_a_table_that_is_too_large():
    entries = {entry.name: entry for entry in choose(view((257, 256)), 5, None, "balanced")}
    assert entries["table"].datapath is None
    assert re.fullmatch(r"a table has 65792 entries of \d+ bits, \d\.\d Mbit; more than 65536 entries are not built",
                        entries["table"].verdict)  # fmt: skip
    small = {entry.name: entry for entry in choose(view((64, 48)), 5, None, "balanced")}
    assert small["table"].verdict in ("chosen", "costs more") and small["table"].error <= 1 / 64


def test_a_budget_below_rounding_is_refused():
    with pytest.raises(InputError, match=r"^--max-error: 0\.01: rounding to 5 fraction bits alone costs"):
        Table.fit(view(), 5, 0.01)


def test_the_largest_table_that_is_built_is_a_file_of_few_lines():
    exact = view((256, 256))
    assert exact.width * exact.height == MOST_ENTRIES
    text = build(exact, Options("table"), "rectify").verilog
    assert text.count("\n") <= 3000
    # All the words are there.
    table = Table.fit(exact, 5)
    u, v = (values.ravel().astype(np.int64) for _, values in table.stored.values())
    bits_u, bits_v = (q.width for q in table.formats.values())
    words = (v % 2**bits_v << bits_u) + u % 2**bits_u
    found = re.findall(r"\bmemory\[(\d+)\] = \d+'h([0-9a-f]+);", text)
    assert [int(index) for index, _ in found] == list(range(MOST_ENTRIES))
    np.testing.assert_array_equal([int(word, 16) for _, word in found], words)
