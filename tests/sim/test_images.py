"""Image files become source frames pixel for pixel, or are refused with the reason."""

import struct
import zlib

import cv2
import numpy as np
import pytest

from hdl.errors import InputError
from sim.images import in_8_bits, read_image

WIDTH, HEIGHT = 16, 4
GRAY = np.arange(WIDTH * HEIGHT, dtype=np.uint8).reshape(HEIGHT, WIDTH) * 3
COLOUR = np.dstack([GRAY, 255 - GRAY, GRAY // 2])


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def read(file, pixel_bits=8, channels=1, size=(WIDTH, HEIGHT), built=False):
    from pathlib import Path

    return read_image(Path(file), size, pixel_bits, channels, built=built)


def refusal(*arguments, **options):
    with pytest.raises(InputError) as caught:
        read(*arguments, **options)
    return str(caught.value)


def chunk(kind, content):
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def write_png(name, bits, kind, rows, *others):
    """A PNG file of the rows' bytes. Source: W3C, Portable Network Graphics."""
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", WIDTH, HEIGHT, bits, kind, 0, 0, 0))
    pixels = chunk(b"IDAT", zlib.compress(b"".join(b"\0" + bytes(row) for row in rows)))
    content = b"\x89PNG\r\n\x1a\n" + header + b"".join(others) + pixels + chunk(b"IEND", b"")
    with open(name, "wb") as file:
        file.write(content)
    return name


def write(name, image):
    assert cv2.imwrite(name, image)
    return name


@pytest.mark.parametrize("name", ["x.png", "x.tiff", "x.bmp", "x.pgm"])
def test_gray_images_are_taken_as_they_are(name):
    assert np.array_equal(read(write(name, GRAY)), GRAY)
    assert np.array_equal(read(name, channels=3), np.dstack([GRAY] * 3))
    found = read(name, pixel_bits=12)
    assert found.dtype == np.uint16 and np.array_equal(found, GRAY.astype(np.uint16) << 4)
    assert np.array_equal(in_8_bits(found, 12), GRAY)


def test_colour_images_are_gray_for_gray_cores():
    write("x.png", COLOUR)
    assert np.array_equal(read("x.png", channels=3), COLOUR)
    assert np.array_equal(read("x.png"), cv2.cvtColor(COLOUR, cv2.COLOR_BGR2GRAY))


@pytest.mark.parametrize("channels", [1, 3])
def test_16_bits_that_hold_8_are_those_8(channels):
    image = GRAY if channels == 1 else COLOUR
    write("x.png", image.astype(np.uint16))
    found = read("x.png", channels=channels)
    assert found.dtype == np.uint8 and np.array_equal(found, image)


def test_16_bits_are_taken_by_cores_that_have_as_many():
    image = GRAY.astype(np.uint16) * 5
    write("x.png", image)
    for bits in (10, 12, 16):
        found = read("x.png", pixel_bits=bits)
        assert found.dtype == np.uint16 and np.array_equal(found, image)


@pytest.mark.parametrize(
    "image, bits, channels, built, problem",
    [
        (GRAY.astype(np.uint16) * 5, 8, 1, False, "pixels = up to 945: do not fit 8 bits; --pixel-bits 10 does"),
        (
            GRAY.astype(np.uint16) * 21,
            10,
            1,
            True,
            "pixels = up to 3969: do not fit 10 bits; generate the cores with --pixel-bits 12",
        ),
        (
            GRAY.astype(np.uint16) << 6,
            10,
            1,
            True,
            "pixels = up to 12096: do not fit 10 bits, but would, 6 bits further down: save it that way",
        ),
        (
            COLOUR.astype(np.uint16) * 5,
            8,
            3,
            True,
            "pixels = up to 1275: do not fit 8 bits, which is what cores of 3 channels have; save it with 8 bits",
        ),
        (GRAY.astype(np.float32), 8, 1, False, "pixels = float32: 8 or 16 bits without a sign are needed"),
        (GRAY.astype(np.int16), 8, 1, False, "pixels = int16: 8 or 16 bits without a sign are needed"),
        (GRAY.astype(np.int32), 8, 3, False, "pixels = int32: 8 or 16 bits without a sign are needed"),
    ],
)
def test_pixels_that_no_such_core_takes_are_refused(image, bits, channels, built, problem):
    write("x.tiff", image)
    assert refusal("x.tiff", bits, channels, built=built) == f"x.tiff: {problem}"


def test_transparency_is_left_out_and_palettes_are_looked_up():
    write("x.png", np.dstack([COLOUR, GRAY]))
    assert np.array_equal(read("x.png", channels=3), COLOUR)
    write_png("gray.png", 8, 4, [[v for value in row for v in (value, 7)] for row in GRAY])
    assert np.array_equal(read("gray.png"), GRAY)
    palette = [(value, 255 - value, value // 2) for value in range(16)]
    colours = chunk(b"PLTE", bytes(v for colour in palette for v in colour))
    write_png("palette.png", 8, 3, [range(16)] * HEIGHT, colours, chunk(b"tRNS", bytes([0, 9])))
    assert np.array_equal(read("palette.png", channels=3), [[colour[::-1] for colour in palette]] * HEIGHT)


def test_images_of_fewer_bits_go_from_black_to_white():
    write_png("one.png", 1, 0, [[0b10101010, 0b11110000]] * HEIGHT)
    assert read("one.png")[0].tolist() == [255, 0] * 4 + [255] * 4 + [0] * 4
    write_png("two.png", 2, 0, [[0b00011011] * 4] * HEIGHT)
    assert read("two.png")[0].tolist() == [0, 85, 170, 255] * 4


@pytest.mark.parametrize("orientation", [3, 6])
def test_images_that_are_to_be_turned_are_refused(orientation):
    write("x.jpg", GRAY)
    tag = b"II*\0\x08\0\0\0\x01\0" + struct.pack("<HHIHHI", 0x112, 3, 1, orientation, 0, 0)
    with open("x.jpg", "rb") as file:
        content = file.read()
    for name, value in (("turned.jpg", orientation), ("upright.jpg", 1)):
        exif = b"Exif\0\0" + tag.replace(struct.pack("<IHH", 1, orientation, 0), struct.pack("<IHH", 1, value, 0))
        with open(name, "wb") as file:
            file.write(content[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + content[2:])
    assert refusal("turned.jpg") == (
        "turned.jpg: orientation: is to be turned when it is shown (EXIF), and the sensor's pixels are not; "
        "save it without that"
    )
    assert np.array_equal(read("upright.jpg"), read("x.jpg"))


@pytest.mark.parametrize("name", ["x.png", "x.bmp", "x.tiff", "x.jpg"])
def test_half_an_image_is_refused_in_one_line(name, capfd):
    write(name, np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH), np.uint8))
    with open(name, "rb") as file:
        content = file.read()
    with open(name, "wb") as file:
        file.write(content[: len(content) * 2 // 3])
    problem = "ends in the middle of the image" if name == "x.jpg" else "is not an image that OpenCV can read"
    assert refusal(name) == f"{name}: {problem}"
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "size, built, problem",
    [
        ((32, 8), False, "the cores take 32x8; --size 16x4 scales the calibration"),
        ((32, 8), True, "the cores take 32x8; generate them with --size 16x4"),
        ((16, 5), True, "the cores take 16x5"),
    ],
)
def test_images_of_another_size_are_refused_with_what_would_help(size, built, problem):
    write("x.png", GRAY)
    assert refusal("x.png", size=size, built=built) == f"x.png: size = 16x4: {problem}"
