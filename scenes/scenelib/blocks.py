# SPDX-License-Identifier: GPL-3.0-or-later
"""Watertight geometry from boxes.

`Blocks` is a list of boxes filled with or carved out of nothing, in order. Their faces cut space
into a non-uniform grid of solid and empty cells; the faces between the two are the mesh, split
along the whole grid, so that no T-junction can arise. Columns replace part of a floor (and of a
ceiling) by a ring of triangles around a polygon and stay part of the same closed mesh.
"""
import math


class Mesh:
    """Triangles as (material, three points); corners at the same position are the same vertex."""

    def __init__(self, name):
        self.name = name
        self.triangles = []

    def add(self, material, a, b, c):
        if a != b and b != c and c != a:
            self.triangles.append((material, (a, b, c)))

    def add_quad(self, material, a, b, c, d):
        self.add(material, a, b, c)
        self.add(material, a, c, d)

    def materials(self):
        return sorted({material for material, _ in self.triangles})


class Blocks:
    """Boxes are pairs of corners (lo, hi), metres. Materials are names."""

    def __init__(self, name):
        self.name = name
        self.operations = []
        self.patches = []
        self.columns = []

    def fill(self, lo, hi, material, own=False):
        """A solid box. With `own`, its faces keep this material whatever the space beside says."""
        self.operations.append((rounded(lo), rounded(hi), material, own, None))

    def carve(self, lo, hi, **paint):
        """An empty box. `paint`: material of the surfaces that bound it, by the box's side that
        they are on: west (-x), east (+x), floor (-y), ceiling (+y), north (-z), south (+z), or
        walls for the upright ones that are not named."""
        sides = {}
        for side, key in (("west", (0, -1)), ("east", (0, 1)), ("north", (2, -1)),
                          ("south", (2, 1))):
            sides[key] = paint.get(side, paint.get("walls"))
        sides[(1, -1)] = paint.get("floor")
        sides[(1, 1)] = paint.get("ceiling")
        self.operations.append((rounded(lo), rounded(hi), None, False, sides))

    def patch(self, lo, hi, material):
        """Surfaces inside this (flat) box get this material."""
        self.patches.append((rounded(lo), rounded(hi), material))

    def column(self, lo, hi, polygon, rings, material):
        """A column on the footprint lo..hi (x, z) from rings [(y, scale)] of `polygon`, points
        (x, z) around the footprint's centre. It stands on the floor at the first ring's y and ends
        in the ceiling at the last ring's y if there is one, else in a flat top."""
        self.columns.append((rounded(lo), rounded(hi), polygon, rings, material))

    def cuts(self, axis):
        values = set()
        for lo, hi, *_ in self.operations + self.patches:
            values |= {lo[axis], hi[axis]}
        for lo, hi, *_ in self.columns:
            if axis != 1:
                values |= {lo[axis // 2], hi[axis // 2]}
        return sorted(values)

    def cells(self, cuts):
        """Cell index -> (material, own, paint of an empty one); the last box over it counts."""
        index = [{value: i for i, value in enumerate(axis)} for axis in cuts]
        cells = {}
        for lo, hi, material, own, sides in self.operations:
            spans = [range(index[a][lo[a]], index[a][hi[a]]) for a in range(3)]
            for i in spans[0]:
                for j in spans[1]:
                    for k in spans[2]:
                        cells[i, j, k] = (material, own, sides)
        return cells

    def mesh(self, keep=None, warp=None):
        """The boundary of the solid. `keep(centre, normal_axis, sign)` leaves faces out (for single
        sheets); `warp(point)` moves every vertex."""
        cuts = [self.cuts(axis) for axis in range(3)]
        mesh = Mesh(self.name)
        cells = self.cells(cuts)
        for cell, (material, own, _) in sorted(cells.items()):
            if material is None:
                continue
            for axis in range(3):
                for sign in (-1, 1):
                    beside = list(cell)
                    beside[axis] += sign
                    other = cells.get(tuple(beside), (None, False, {}))
                    if other[0] is None:
                        paint = None if own else (other[2] or {}).get((axis, -sign))
                        self.add_face(mesh, cuts, cell, axis, sign, paint or material, keep)
        for column in self.columns:
            self.add_column(mesh, cuts, cells, *column)
        if warp:
            mesh = warped(mesh, warp)
        return mesh

    def add_face(self, mesh, cuts, cell, axis, sign, material, keep):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        corners = []
        for db, dc in ((0, 0), (1, 0), (1, 1), (0, 1)):
            corner = [0.0, 0.0, 0.0]
            corner[axis] = cuts[axis][cell[axis] + (sign > 0)]
            corner[b] = cuts[b][cell[b] + db]
            corner[c] = cuts[c][cell[c] + dc]
            corners.append(tuple(corner))
        centre = tuple((corners[0][a] + corners[2][a]) / 2 for a in range(3))
        if keep and not keep(centre, axis, sign):
            return
        if axis == 1 and self.under_column(centre, sign):
            return
        for lo, hi, patch in self.patches:
            if all(lo[a] <= centre[a] <= hi[a] for a in range(3)) and lo[axis] == hi[axis]:
                material = patch
        mesh.add_quad(material, *(corners if sign > 0 else corners[::-1]))

    def under_column(self, centre, sign):
        for lo, hi, _, rings, _ in self.columns:
            inside = lo[0] < centre[0] < hi[0] and lo[1] < centre[2] < hi[1]
            if inside and centre[1] == (rings[0][0] if sign > 0 else rings[-1][0]):
                return True
        return False

    def add_column(self, mesh, cuts, cells, lo, hi, polygon, rings, material):
        middle = ((lo[0] + hi[0]) / 2, (lo[1] + hi[1]) / 2)
        loops = [[(middle[0] + scale * x, y, middle[1] + scale * z) for x, z in polygon]
                 for y, scale in rings]
        count = len(polygon)
        for low, high in zip(loops, loops[1:]):
            for i in range(count):
                j = (i + 1) % count
                mesh.add_quad(material, low[i], high[i], high[j], low[j])
        floor = self.ground_material(cuts, cells, lo, hi, rings[0][0], -1)
        add_ring(mesh, floor, footprint(cuts, lo, hi, rings[0][0]), loops[0], middle, flip=False)
        ceiling = self.ground_material(cuts, cells, lo, hi, rings[-1][0], 1)
        if ceiling:
            around = footprint(cuts, lo, hi, rings[-1][0])
            add_ring(mesh, ceiling, around, loops[-1], middle, flip=True)
        else:
            for i in range(1, count - 1):
                mesh.add(material, loops[-1][0], loops[-1][i + 1], loops[-1][i])

    def ground_material(self, cuts, cells, lo, hi, y, side):
        """The material of a footprint's floor (side -1) or ceiling (1) at height y, or None."""
        if y not in cuts[1]:
            return None
        i, k = cuts[0].index(lo[0]), cuts[2].index(lo[1])
        level = cuts[1].index(y)
        solid = cells.get((i, level - 1 if side < 0 else level, k), (None, False, None))
        empty = cells.get((i, level if side < 0 else level - 1, k), (None, False, {}))
        if solid[0] is None or empty[0] is not None:
            return None
        return (empty[2] or {}).get((1, side)) or solid[0]


def rounded(point):
    """To a micrometre, so that sums like 0.1 + 0.2 do not open slivers beside 0.3."""
    return tuple(round(float(c), 6) for c in point)


def footprint(cuts, lo, hi, y):
    """The grid's vertices around a rectangle of floor, in the order of rising angle from x to z."""
    xs = [x for x in cuts[0] if lo[0] <= x <= hi[0]]
    zs = [z for z in cuts[2] if lo[1] <= z <= hi[1]]
    loop = [(x, y, zs[0]) for x in xs[:-1]] + [(xs[-1], y, z) for z in zs[:-1]]
    return loop + [(x, y, zs[-1]) for x in xs[:0:-1]] + [(xs[0], y, z) for z in zs[:0:-1]]


def add_ring(mesh, material, outer, inner, middle, flip):
    """Triangles between two convex loops around `middle`, both of rising angle from x to z; their
    normal is +y, or -y with `flip`. The loops advance by angle, but an inner edge waits for the
    first outer point that sees it from outside: from a corner, the far edges of a round loop would
    make triangles that face the other way and overlap their neighbours."""
    def angles(loop):
        first = math.atan2(loop[0][2] - middle[1], loop[0][0] - middle[0])
        turns = [(math.atan2(p[2] - middle[1], p[0] - middle[0]) - first + 1e-9) % math.tau
                 for p in loop]
        return [first + turn for turn in turns] + [first + math.tau]

    start = min(range(len(inner)), key=lambda i: math.dist(inner[i], outer[0]))
    inner = inner[start:] + inner[:start]
    a, b = angles(outer), angles(inner)
    b = [angle - math.tau * round((b[0] - a[0]) / math.tau) for angle in b]
    i = j = 0
    while i < len(outer) or j < len(inner):
        p, q = outer[i % len(outer)], inner[j % len(inner)]
        along_outer = (p, q, outer[(i + 1) % len(outer)])
        along_inner = (p, q, inner[(j + 1) % len(inner)])
        by_angle = i == len(outer) or (j < len(inner) and b[j + 1] < a[i + 1])
        if by_angle and faces_up(*along_inner):
            j += 1
            corners = along_inner
        else:
            i += 1
            corners = along_outer
        if i > len(outer) or not faces_up(*corners):
            raise ValueError("a ring of %s: the inner loop is not inside the outer" % material)
        mesh.add(material, *(corners[::-1] if flip else corners))


def faces_up(a, b, c):
    return (b[2] - a[2]) * (c[0] - a[0]) > (b[0] - a[0]) * (c[2] - a[2])


def warped(mesh, warp):
    """Every vertex moved; triangles that collapse to a line or a point are left out."""
    out = Mesh(mesh.name)
    for material, corners in mesh.triangles:
        out.add(material, *(tuple(round(c, 9) for c in warp(p)) for p in corners))
    return out


def circle(radius, count):
    """A polygon for columns: `count` points (x, z) on a circle, of rising angle from x to z."""
    return [(radius * math.cos(math.tau * i / count), radius * math.sin(math.tau * i / count))
            for i in range(count)]


def rectangle(width, depth, turn_deg):
    """A turned rectangle for columns, of rising angle from x to z."""
    c, s = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
    corners = [(-width / 2, -depth / 2), (width / 2, -depth / 2), (width / 2, depth / 2),
               (-width / 2, depth / 2)]
    return [(c * x - s * z, s * x + c * z) for x, z in corners]


def icosphere(name, material, levels, radius):
    """A sphere of 20 * 4^levels triangles facing in, with the area 4 pi radius^2."""
    t = (1 + math.sqrt(5)) / 2
    points = [(-1, t, 0), (1, t, 0), (-1, -t, 0), (1, -t, 0), (0, -1, t), (0, 1, t),
              (0, -1, -t), (0, 1, -t), (t, 0, -1), (t, 0, 1), (-t, 0, -1), (-t, 0, 1)]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4),
             (11, 10, 2), (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8),
             (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]

    def unit(p):
        length = math.hypot(*p)
        return tuple(c / length for c in p)

    def between(p, q):
        return unit(tuple(a + b for a, b in zip(p, q)))

    triangles = [tuple(unit(points[i]) for i in face) for face in faces]
    for _ in range(levels):
        finer = []
        for a, b, c in triangles:
            ab, bc, ca = between(a, b), between(b, c), between(c, a)
            finer += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        triangles = finer
    area = sum(triangle_area(*triangle) for triangle in triangles)
    scale = radius * math.sqrt(4 * math.pi / area)
    mesh = Mesh(name)
    for a, b, c in triangles:
        a, c, b = (tuple(round(scale * v, 9) for v in p) for p in (a, b, c))
        mesh.add(material, a, b, c)
    return mesh


def triangle_area(a, b, c):
    u = [b[i] - a[i] for i in range(3)]
    v = [c[i] - a[i] for i in range(3)]
    return 0.5 * math.hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                            u[0] * v[1] - u[1] * v[0])
