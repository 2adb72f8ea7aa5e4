"""`DifferenceForm` by its definition: sums of binomials in Python's integers, and their differences by subtraction."""

from math import comb

import numpy as np

from hdl.arithmetic.differences import jump_name, value_name


def along(position, k, cell):
    """The k-th function of `DifferenceForm` by its definition: nodes at the cells' ends, and lines between them."""
    if k == 0:
        return 1
    i, distance = divmod(position, cell)
    return cell * comb(i, k) + distance * (comb(i + 1, k) - comb(i, k))


def value(form, x, y):
    """The value at a position, in or beyond the frame, in Python's integers."""
    total = 0
    for k in range(form.degree + 1):
        for n in range(form.degree + 1 - k):
            term = int(form.coefficients[k, n]) * along(y, n, form.cell_height)
            if (k, n) == (1, 1) and form.cell_height > 1:
                # The slope is rounded to its unit, half up.
                exact = int(form.coefficients[1, 1]) * y
                term = (2 * exact + form.cell_height) // (2 * form.cell_height)
            total += term * along(x, k, form.cell_width)
    return total


def differences(form):
    """All that is accumulated, name to lists, from nothing but the values.

    The value in each row, pixel by pixel; differences along it, cell by cell; jumps, one number a row.
    """
    rows, cells = range(form.height + form.degree), range(form.cells + form.degree)
    nodes = [[value(form, i * form.cell_width, y) for i in cells] for y in rows]
    steps = [[value(form, i * form.cell_width + 1, y) for i in cells] for y in rows]
    found = {value_name(0): [[value(form, x, y) for x in range(form.width)] for y in range(form.height)]}
    row = [[after - before for after, before in zip(*pair)] for pair in zip(steps, nodes)]
    last = [value(form, form.width - 1, y) for y in rows]
    levels = [([node[0] for node in nodes], last)]
    for k in range(1, form.degree + 1):
        found[value_name(k)] = [line[: form.cells] for line in row[: form.height]]
        levels.append(([line[0] for line in row], [line[form.cells - 1] for line in row]))
        row = [np.diff(np.array(line, object)).tolist() for line in row]
    for k, (first, last) in enumerate(levels[: form.degree]):
        jump = np.array([after - before for after, before in zip(first[1:], last)], object)
        for n in range(form.degree - k):
            found[jump_name(k, n)] = jump[: form.height].tolist()
            jump = np.diff(jump)
    return found
