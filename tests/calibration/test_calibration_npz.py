"""NumPy's archives, which may hold anything: matrices are read, maps passed over, and pickles never loaded."""

import os
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
from calibration_files import refusal, write
from loose_files import RIG, is_the_rig, npz

from hdl.calibration import load


@pytest.fixture(autouse=True)
def folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_compressed_archive_with_large_maps_is_read_with_little_memory():
    maps = {f"map{n}": np.zeros((1080, 1920), np.float32) for n in range(4)}
    stored, packed = npz(RIG | maps), npz(RIG | maps, "packed.npz", np.savez_compressed)
    assert os.path.getsize(stored) > 30 << 20 and os.path.getsize(packed) < 1 << 20
    tracemalloc.start()
    for path in (stored, packed):
        is_the_rig(load(path))
    assert tracemalloc.get_traced_memory()[1] < 16 << 20
    tracemalloc.stop()


def test_large_archive_in_a_folder_is_found():
    Path("folder").mkdir()
    npz(RIG | {"map": np.zeros((1080, 1920))}, "folder/rig.npz")
    write(b"\x89PNG" + bytes(2 << 20), "folder/large.png")
    is_the_rig(load("folder"))


def test_pickles_are_never_loaded():
    class Bomb:
        def __reduce__(self):
            return Path.touch, (Path("exploded"),)

    bomb = np.array([Bomb()], dtype=object)
    is_the_rig(load(npz(RIG | {"rvecs": bomb})))
    assert refusal(npz(RIG | {"K1": bomb})) == (
        "rig.npz: K1 = a pickled object, which is never loaded: a matrix with rows, cols, dt and data, or a "
        "sequence, is needed"
    )
    assert not Path("exploded").exists()


@pytest.mark.parametrize("dtype", [np.float32, np.float16, ">f8", np.int64])
def test_numbers_of_any_type_are_numbers(dtype):
    np.savez("rig.npz", **{key: np.array(value, dtype=dtype) for key, value in RIG.items() if key[0] in "Ki"},
             **{key: np.asfortranarray(value) for key, value in RIG.items() if key[0] not in "Ki"})  # fmt: skip
    rig = load("rig.npz")
    assert rig.left.K[0, 0] == pytest.approx(500.25, rel=1e-3) and rig.R[0, 1] == RIG["R"][0][1]


def header(text):
    text = text.encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


@pytest.mark.parametrize("member", [
    "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 1000000)}",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (-1,)}",
    "{'descr': 'no type', 'fortran_order': False, 'shape': (1,)}",
    "(" * 5000, "-" * 9000 + "1", "{'descr': '<f8'}", "", "{'descr': '|O', 'fortran_order': False, 'shape': ()}",
])  # fmt: skip
def test_hostile_header_is_refused(member):
    with zipfile.ZipFile("rig.npz", "w") as archive:
        archive.writestr("K1.npy", header(member) + bytes(8))
    assert refusal("rig.npz")


def test_bomb_is_passed_over():
    with zipfile.ZipFile("rig.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("K1.npy", bytes(64 << 20))
    tracemalloc.start()
    assert refusal("rig.npz").startswith("rig.npz: K1: missing; ")
    assert tracemalloc.get_traced_memory()[1] < 16 << 20
    tracemalloc.stop()


@pytest.mark.parametrize("damage, message", [
    (lambda data: data[: len(data) // 2], "it does not end in a directory as NumPy writes it"),
    (lambda data: data + b"tail", "it does not end in a directory as NumPy writes it"),
    (lambda data: data[:40], "it does not end in a directory as NumPy writes it"),
    (lambda data: data[:8], "unpack requires a buffer of 22 bytes"),
    (lambda data: data[:-12] + b"\xff\xff" + data[-10:], "more than 256 arrays"),
    (lambda data: data.replace(b"NUMPY", b"MUMPY"), "Bad CRC-32 for file 'image_size.npy'"),
])  # fmt: skip
def test_broken_archive_is_refused_in_one_line(damage, message):
    data = Path(npz(RIG)).read_bytes()
    assert refusal(write(damage(data), "rig.npz")) == f"rig.npz: not a NumPy archive, or a broken one: {message}"


def test_archive_of_something_else_is_refused():
    with zipfile.ZipFile("rig.npz", "w") as archive:
        archive.writestr("word/document.xml", "<w/>")
    assert refusal("rig.npz") == "rig.npz: not a NumPy archive: there are no arrays in it"


def test_archive_with_any_bytes_changed_is_read_or_refused():
    data = Path(npz(RIG)).read_bytes()
    rng = np.random.default_rng(2)
    for _ in range(300):
        content = bytearray(data)
        for place in rng.integers(0, len(data), 3):
            content[place] = rng.integers(256)
        write(bytes(content), "rig.npz")
        try:
            load("rig.npz")
        except ValueError as error:
            assert "\n" not in str(error)
