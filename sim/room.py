"""The test scene: a room with a brick wall, a bookcase, a calibration board and some things on the floor.

Lengths are in units of the distance to the back wall, in the room's frame (x right, y down, z away from the cameras);
sideways they are scaled with the field of view, so that the composition is the same for every rig.
"""

import numpy as np

from sim.patterns import band, checker, frame, noise, pulse, random, wave
from sim.surfaces import Ball, Box, dot

_WHITE, _CREAM, _INK = (0.95, 0.95, 0.93), (0.86, 0.81, 0.70), (0.08, 0.08, 0.10)
_BRICK, _MORTAR = (0.68, 0.40, 0.31), (0.80, 0.77, 0.72)
_OAK, _WALNUT, _PINE = (0.66, 0.46, 0.29), (0.34, 0.21, 0.14), (0.80, 0.62, 0.40)
_TEAL, _NAVY, _RED, _YELLOW = (0.16, 0.47, 0.47), (0.15, 0.22, 0.38), (0.76, 0.20, 0.16), (0.93, 0.75, 0.22)
_LUMA = np.array([0.299, 0.587, 0.114])


class Room:
    """Surfaces, paint and light.

    Parameters
    ----------
    tx, ty : float
        Tangents of the half field of view of the left camera, whose optical centre is ``eye``.
    pixel : float
        Angle that one of its pixels sees, radians.
    channels : int
        1 for gray, 3 for blue, green, red.
    seed : int
        Changes what varies from brick to brick, plank to plank and book to book.
    """

    eye = np.zeros(3)

    def __init__(self, tx, ty, pixel, channels, seed):
        self.pixel, self.channels, self.seed = pixel, channels, seed
        self.left, self.right, self.top, self.floor = -0.88 * tx, 0.98 * tx, -0.90 * ty, 0.62 * ty
        self.lamp = np.array([-0.25 * tx, -0.75 * ty, 0.42])
        self.unit = ty  # sizes of things follow the height of the picture
        self.shell = Box(
            [(self.left + self.right) / 2, (self.top + self.floor) / 2, 0.3],
            [(self.right - self.left) / 2, (self.floor - self.top) / 2, 0.7],
            self._walls,
            inside=True,
        )
        self.bookcase = self._standing(0.66 * tx, 0.93, (0.27, 0.47, 0.10), self._bookcase)
        self.picture = Box([-0.47 * tx, -0.36 * ty, 0.995], np.multiply((0.27, 0.19, 0.012), ty), self._picture)
        self.board = self._standing(-0.36 * tx, 0.80, (0.24, 0.185, 0.008), self._board, yaw=-0.30, pitch=-0.25)
        self.crate = self._standing(0.16 * tx, 0.82, (0.13, 0.13, 0.13), self._crate, yaw=0.45)
        self.gift = self._standing(0.15 * tx, 0.82, (0.080, 0.055, 0.065), self._gift, on=0.26, yaw=-0.20)
        self.ball = Ball([0.29 * tx, self.floor - 0.105 * ty, 0.70], 0.105 * ty, self._ball, lean=0.45)
        self.rug = self._standing(-0.05 * tx, 0.76, (0.52, 0.006, 0.22), self._rug, yaw=0.06)
        self.furniture = [self.bookcase, self.picture, self.board, self.crate, self.gift, self.ball, self.rug]
        self.surfaces = [self.shell, *self.furniture]

    def _standing(self, x, z, half, skin, on=0.0, **pose):
        """A box on the floor, or so much above it; its size in units."""
        return Box([x, self.floor - (half[1] + on) * self.unit, z], np.multiply(half, self.unit), skin, **pose)

    def trace(self, origin, rays):
        """First surface along unit rays (n, 3) from origin (3,): distance and index into ``surfaces``, each (n,)."""
        distance, index = self.shell.hit(origin, rays), np.zeros(len(rays), np.int64)
        for number, surface in enumerate(self.furniture, 1):
            candidates = _towards(surface, origin, rays)
            if candidates.size:
                hit = surface.hit(origin, rays[candidates])
                nearer = hit < distance[candidates]
                distance[candidates[nearer]] = hit[nearer]
                index[candidates[nearer]] = number
        return distance, index

    def label(self, points, index):
        """A number for each plane or ball that the points are on."""
        label = 8 * index
        for number in np.flatnonzero(np.bincount(index)):
            chosen = np.flatnonzero(index == number)
            label[chosen] += self.surfaces[number].face(points[chosen])
        return label

    def shade(self, points, index):
        """Brightness (n, channels), 0 to 1, of points (n, 3) on the surfaces with these indices."""
        result = np.empty((len(points), self.channels))
        for number in np.flatnonzero(np.bincount(index)):
            chosen = np.flatnonzero(index == number)
            surface, at = self.surfaces[number], points[chosen]
            paint = surface.skin(surface.patch(at, self.eye, self.pixel))
            result[chosen] = paint * self._light(number, at)[:, None]
        return np.clip(result, 0, 1)

    def _light(self, number, points):
        surface = self.surfaces[number]
        to_lamp = self.lamp - points
        distance = np.sqrt(dot(to_lamp, to_lamp))
        to_lamp /= distance[:, None]
        facing = np.maximum(dot(surface.normal(points), to_lamp), 0)
        open_sky = np.ones(len(points))
        for other, caster in enumerate(self.furniture, 1):
            if other == number:
                continue
            candidates = _towards(caster, points, to_lamp, margin=1.3)
            enter, leave = caster.span(points[candidates], to_lamp[candidates])
            soft = 0.10 * caster.radius
            covered = np.clip((np.minimum(leave, distance[candidates]) - np.maximum(enter, 0)) / soft, 0, 1)
            open_sky[candidates] *= 1 - covered * covered * (3 - 2 * covered)
        a, b, c = (self.shell.half - np.abs(points - self.shell.centre)).T
        # The middle one of three distances is small where two walls meet.
        corner = np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c))
        ambient = 1 - 0.45 * np.exp(-corner / (0.10 * self.unit))
        return 0.52 * ambient + 0.85 * facing * open_sky / (0.9 + distance**2)

    def _mix(self, low, high, share):
        low, high = (self._colour(c) if isinstance(c, tuple) else c for c in (low, high))
        return low + (high - low) * share[:, None]

    def _colour(self, rgb):
        return np.array([_LUMA @ rgb]) if self.channels == 1 else np.array(rgb[::-1])

    def _flat(self, patch, rgb):
        return np.broadcast_to(self._colour(rgb), (len(patch.s), self.channels))

    def _by_face(self, patch, skins):
        """Paint each face with its own skin; ``skins`` maps faces to functions of a Patch."""
        result = np.empty((len(patch.s), self.channels))
        for faces, skin in skins.items():
            chosen = np.isin(patch.face, faces)
            if chosen.any():
                result[chosen] = skin(patch.select(chosen))
        return result

    def _walls(self, patch):
        return self._by_face(
            patch, {(0, 1, 4): self._wallpaper, (2,): self._ceiling, (3,): self._planks, (5,): self._bricks}
        )

    def _bricks(self, p):
        height, length, joint = 0.105 * self.unit, 0.27 * self.unit, 0.016 * self.unit
        row = np.floor(p.t / height)
        s = p.s + (row % 2) * length / 2
        column = np.floor(s / length)
        face = pulse(s, p.ws, length, 1 - joint / length) * pulse(p.t, p.wt, height, 1 - joint / height)
        grain = noise(p.s, p.ws, p.t, p.wt, (0.06 * self.unit, 0.03 * self.unit), self.seed)
        tone = 0.7 * random(row, column, self.seed) + 0.3 * grain
        brick = self._mix(tuple(0.72 * c for c in _BRICK), tuple(min(1, 1.25 * c) for c in _BRICK), tone)
        wall = self._mix(_MORTAR, brick, face)
        return self._skirting(p, wall)

    def _wallpaper(self, p):
        stripes = pulse(p.s, p.ws, 0.12 * self.unit)
        paper = self._mix((0.72, 0.76, 0.70), (0.84, 0.86, 0.80), stripes)
        rail = band(p.t, p.wt, 0.18 * self.unit, 0.21 * self.unit)
        panel = band(p.t, p.wt, 0.21 * self.unit, np.inf)
        groove = pulse(p.s, p.ws, 0.24 * self.unit, 0.06) * band(p.t, p.wt, 0.27 * self.unit, 0.60 * self.unit)
        wall = self._mix(self._mix(paper, _CREAM, panel), _WALNUT, np.maximum(rail, 0.5 * groove))
        return self._skirting(p, wall)

    def _skirting(self, p, wall):
        bottom = self.shell.half[1]
        board = band(p.t, p.wt, bottom - 0.075 * self.unit, np.inf)
        lip = band(p.t, p.wt, bottom - 0.075 * self.unit, bottom - 0.060 * self.unit)
        return self._mix(self._mix(wall, _WALNUT, board), _OAK, lip)

    def _ceiling(self, p):
        beam = pulse(p.t, p.wt, 0.28, 0.18)
        return self._mix(_WHITE, _OAK, beam)

    def _planks(self, p):
        width, length = 0.115 * self.unit, 0.55
        lane = np.floor(p.s / width)
        t = p.t + length * random(lane, 0, self.seed + 1)
        board = np.floor(t / length)
        tone = random(lane, board, self.seed + 2)
        grain = noise(p.s, p.ws, t, p.wt, (0.012 * self.unit, 0.16 * self.unit), self.seed + 3)
        wood = self._mix(_WALNUT, _PINE, 0.30 + 0.40 * tone + 0.22 * grain)
        gap = np.maximum(pulse(p.s, p.ws, width, 0.05), pulse(t, p.wt, length, 0.02))
        return self._mix(wood, _INK, 0.75 * gap)

    def _bookcase(self, p):
        return self._by_face(p, {(4,): self._shelves, (0, 1, 2, 3, 5): self._side})

    def _side(self, p):
        grain = noise(p.s, p.ws, p.t, p.wt, (0.02 * self.unit, 0.3 * self.unit), self.seed + 4)
        return self._mix(_WALNUT, _OAK, 0.25 + 0.35 * grain)

    def _shelves(self, p):
        half_s, half_t = self.bookcase.half[:2]
        board, shelf = 0.022 * self.unit, 2 * half_t / 4
        from_top = p.t + half_t
        row = np.floor(from_top / shelf)
        above = shelf - (from_top - row * shelf)  # height over the shelf's lower end
        thickness = 0.042 * self.unit
        s = p.s + 0.02 * self.unit * wave(p.s, 0 * p.s, 0.19 * self.unit, row)  # books of unequal thickness
        book = np.floor(s / thickness)
        tall = shelf * (0.62 + 0.22 * random(book, row, self.seed + 5))
        spine = band(above, p.wt, board, tall) * pulse(s, p.ws, thickness, 0.88)
        which = random(book, row, self.seed + 6)
        palette = np.stack([self._colour(c) for c in (_TEAL, _RED, _CREAM, _NAVY, _YELLOW, _WHITE, _BRICK, _MORTAR)])
        cover = palette[(which * len(palette)).astype(int)]
        label = band(above, p.wt, 0.55 * tall, 0.68 * tall) * (which > 0.3)
        cover = self._mix(cover, self._mix(_CREAM, _INK, np.round(random(book, row, self.seed + 7))), 0.8 * label)
        inside = self._mix(tuple(0.5 * c for c in _WALNUT), cover, spine)
        boards = np.maximum(frame(p.s, p.ws, p.t, p.wt, half_s, half_t, board), 1 - band(above, p.wt, board, shelf))
        return self._mix(inside, self._side(p), boards)

    def _picture(self, p):
        half_s, half_t = self.picture.half[:2]
        s, t, ws, wt = p.s / half_s, p.t / half_t, p.ws / half_s, p.wt / half_t
        scene = self._mix((0.93, 0.86, 0.66), (0.45, 0.62, 0.78), np.clip(0.3 - 0.8 * t, 0, 1))
        sun = np.hypot(half_s / half_t * (s - 0.35), t + 0.35)
        scene = self._mix(scene, _YELLOW, band(sun, wt, -np.inf, 0.17))
        for level, colour in ((0.0, (0.42, 0.52, 0.58)), (0.28, (0.24, 0.38, 0.36)), (0.52, (0.13, 0.22, 0.18))):
            ridge = level + 0.13 * np.sin(4.1 * s + 9 * level) + 0.07 * np.sin(9.7 * s + 3 * level)
            scene = self._mix(scene, colour, band(t, wt, ridge, np.inf))
        mount = frame(s, ws, t, wt, 1, 1, 0.24)
        wood = frame(s, ws, t, wt, 1, 1, 0.09)
        return self._mix(self._mix(scene, _WHITE, mount), _INK, wood)

    def _board(self, p):
        return self._by_face(p, {(4,): self._squares, (0, 1, 2, 3, 5): lambda side: self._flat(side, _OAK)})

    def _squares(self, p):
        size = self.board.half[1] / 4
        half_s, half_t = 4.5 * size, 3 * size
        # The footprint stays inside the pattern, which would go on under the margin.
        s = np.clip(p.s, p.ws / 2 - half_s, half_s - p.ws / 2)
        t = np.clip(p.t, p.wt / 2 - half_t, half_t - p.wt / 2)
        squares = checker(s + size / 2, p.ws, t, p.wt, size)
        return self._mix(self._mix(_INK, _WHITE, squares), _WHITE, frame(p.s, p.ws, p.t, p.wt, half_s, half_t, 0))

    def _crate(self, p):
        half = self.crate.half[0]
        slats = pulse(p.t + half, p.wt, half / 2.5, 0.90)
        rails = frame(p.s, p.ws, p.t, p.wt, half, half, 0.16 * half)
        grain = noise(p.t, p.wt, p.s, p.ws, (0.10 * half, half), self.seed + 8)
        plain = self._mix(_OAK, _PINE, 0.2 + 0.6 * grain)
        wood = self._mix(_INK, plain, 0.25 + 0.75 * slats)
        groove = rails - frame(p.s, p.ws, p.t, p.wt, half, half, 0.13 * half)
        return self._mix(self._mix(wood, plain, rails), _WALNUT, groove)

    def _gift(self, p):
        half = self.gift.half[0]
        ribbon = np.maximum(band(p.s, p.ws, -0.16 * half, 0.16 * half), band(p.t, p.wt, -0.16 * half, 0.16 * half))
        return self._mix(_TEAL, _CREAM, ribbon)

    def _ball(self, p):
        sector = np.pi / 4
        stripes = pulse(p.s, p.ws, 2 * sector)
        cap = band(np.abs(p.t), p.wt, 1.2, np.inf)
        return self._mix(self._mix(_RED, _WHITE, stripes), _YELLOW, cap)

    def _rug(self, p):
        return self._by_face(p, {(2,): self._stripes, (0, 1, 3, 4, 5): lambda side: self._flat(side, _CREAM)})

    def _stripes(self, p):
        half_s, _, half_t = self.rug.half
        stripes = pulse(p.t, p.wt, half_t / 3.5, 0.55)
        edge = frame(p.s, p.ws, p.t, p.wt, half_s, half_t, 0.05 * self.unit)
        return self._mix(self._mix(_NAVY, (0.45, 0.52, 0.60), stripes), _CREAM, edge)


def _towards(surface, origin, rays, margin=1.0):
    """Indices of the unit rays that meet the ball around a surface, enlarged by ``margin``."""
    to_centre = surface.centre - origin
    along, square = dot(rays, to_centre), dot(to_centre, to_centre)
    radius = margin * surface.radius
    return np.flatnonzero((square - along * along < radius**2) & ((along > 0) | (square < radius**2)))
