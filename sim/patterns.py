"""Procedural patterns, averaged over the footprint of a pixel so that they do not alias.

Arguments ``x``, ``s``, ``t`` are positions on a surface, ``w``, ``ws``, ``wt`` the width of the pixel's footprint there
along the same direction, all in one unit and of one shape. Results are float64 of that shape, 0 to 1 unless stated.
"""

import numpy as np


def band(x, w, low, high):
    """1 within low..high, 0 outside."""
    return np.clip((np.minimum(x + w / 2, high) - np.maximum(x - w / 2, low)) / w, 0, 1)


def frame(s, ws, t, wt, half_s, half_t, border):
    """1 on the border, this wide, of a rectangle around the origin."""
    inside = band(s, ws, border - half_s, half_s - border) * band(t, wt, border - half_t, half_t - border)
    return 1 - inside


def pulse(x, w, period, duty=0.5):
    """1 for the first ``duty`` of every period, which starts at 0."""
    on = period * duty

    def integral(at):
        cell = np.floor(at / period)
        return cell * on + np.minimum(at - cell * period, on)

    return (integral(x + w / 2) - integral(x - w / 2)) / w


def checker(s, ws, t, wt, size):
    """Squares of this size, black at the origin's lower right."""
    return 0.5 - 0.5 * (2 * pulse(s, ws, 2 * size) - 1) * (2 * pulse(t, wt, 2 * size) - 1)


def wave(x, w, period, phase=0.0):
    """Sine, -1 to 1."""
    return np.sin(2 * np.pi * x / period + phase) * np.sinc(w / period)


def random(i, j, seed):
    """A number for every pair of integers, as a fixed function of it and of the seed."""
    i, j = np.asarray(i).astype(np.int64).astype(np.uint32), np.asarray(j).astype(np.int64).astype(np.uint32)
    h = i * np.uint32(0x9E3779B1) + j * np.uint32(0x85EBCA77) + np.uint32(seed * 0xC2B2AE3D & 0xFFFFFFFF)
    h = (h ^ (h >> 15)) * np.uint32(0x2C1B3C6D)
    h = (h ^ (h >> 12)) * np.uint32(0x297A2D39)
    return (h ^ (h >> 15)).astype(np.float64) / 2**32


def noise(s, ws, t, wt, size, seed):
    """Smooth noise with lattice cells of this size (a number, or one along s and one along t); mean 0.5."""
    size_s, size_t = np.broadcast_to(size, 2)
    s, t = s / size_s, t / size_t
    i, j = np.floor(s), np.floor(t)
    a, b = s - i, t - j
    a, b = a * a * (3 - 2 * a), b * b * (3 - 2 * b)
    above = random(i, j, seed) * (1 - a) + random(i + 1, j, seed) * a
    below = random(i, j + 1, seed) * (1 - a) + random(i + 1, j + 1, seed) * a
    # The lattice is gone where the footprint covers a cell: fade before that, it would alias.
    fade = np.clip(2 - 2 * np.maximum(ws / size_s, wt / size_t), 0, 1)
    return 0.5 + (above * (1 - b) + below * b - 0.5) * fade
