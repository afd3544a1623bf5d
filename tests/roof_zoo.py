"""Generated compound roofs with everything that makes composing hard; each kind takes a seeded
generator.
"""

import numpy as np
import shapely
from shapely import affinity

from hiproof.compose import compose
from hiproof.frames import LocalFrame
from hiproof.model import Part, Piece, Roof

FRAME = LocalFrame(np.zeros(3))


def roof(pieces, outline):
    """A roof of one-piece parts over the largest polygon of `outline`."""
    outline = max(shapely.get_parts(outline), key=lambda polygon: polygon.area)
    return Roof(tuple(Part("free", (piece,)) for piece in pieces), outline, FRAME)


def rectangle(x, y, width, depth, degrees=0.0):
    return affinity.rotate(
        shapely.box(x - width / 2, y - depth / 2, x + width / 2, y + depth / 2), degrees, (x, y)
    )


def gable_planes(x, y, z_ridge, slope, degrees):
    """Two planes falling away from a ridge through (x, y) in direction `degrees`."""
    n = np.array([-np.sin(np.deg2rad(degrees)), np.cos(np.deg2rad(degrees))])
    rise = slope * n
    return np.array([[*rise, z_ridge - rise @ [x, y]], [*-rise, z_ridge + rise @ [x, y]]])


def random_planes(rng, box):
    """Min of one to four planes with their apex somewhere over `box`."""
    x, y = rng.uniform(box[:2], box[2:])
    z = rng.uniform(3, 12)
    kind = rng.integers(5)
    if kind == 0:
        return np.array([[0.0, 0.0, round(z, 1)]])
    if kind == 1:
        a, b = rng.uniform(-1, 1, 2)
        return np.array([[a, b, z - a * x - b * y]])
    degrees = rng.choice([0.0, 90.0, rng.uniform(0, 180)])
    planes = gable_planes(x, y, z, rng.uniform(0.1, 1.5), degrees)
    if kind >= 3:
        planes = np.vstack(
            (planes, gable_planes(x, y, z + rng.uniform(0, 2), rng.uniform(0.1, 2.5), degrees + 90))
        )
    if kind == 4:
        planes = np.vstack((planes, [[0.0, 0.0, z - rng.uniform(0.0, 1.0)]]))
    return planes


def guillotine(rng, box, depth):
    """A rectangle cut `depth` times, now and then at a multiple of half a metre so that cuts line
    up.
    """
    x0, y0, x1, y1 = box
    if depth == 0 or min(x1 - x0, y1 - y0) < 1.5:
        return [box]
    share = rng.uniform(0.2, 0.8)
    if x1 - x0 > y1 - y0:
        cut = x0 + share * (x1 - x0)
        cut = round(2 * cut) / 2 if rng.random() < 0.5 else cut
        return guillotine(rng, (x0, y0, cut, y1), depth - 1) + guillotine(
            rng, (cut, y0, x1, y1), depth - 1
        )
    cut = y0 + share * (y1 - y0)
    cut = round(2 * cut) / 2 if rng.random() < 0.5 else cut
    return guillotine(rng, (x0, y0, x1, cut), depth - 1) + guillotine(
        rng, (x0, cut, x1, y1), depth - 1
    )


def footprint(rng, width, depth):
    """A random footprint: box, L, U, courtyard, blob or row slice."""
    base = shapely.box(-width / 2, -depth / 2, width / 2, depth / 2)
    kind = rng.integers(6)
    if kind == 1:
        base = base.difference(
            rectangle(width / 2, depth / 2, rng.uniform(0.4, width), rng.uniform(0.4, depth))
        )
    elif kind == 2:
        base = base.difference(
            rectangle(rng.uniform(-1, 1), depth / 2, width / 3, rng.uniform(0.4, 1.2 * depth))
        )
    elif kind == 3:
        base = base.difference(
            rectangle(
                *rng.uniform(-1, 1, 2), width / 3, depth / 3, rng.choice([0, rng.uniform(0, 90)])
            )
        )
    elif kind == 4:
        turn = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(5, 16)))
        radius = rng.uniform(0.4, 1.0, len(turn))
        blob = shapely.Polygon(
            np.column_stack((width / 2 * radius * np.cos(turn), depth / 2 * radius * np.sin(turn)))
        )
        base = blob if blob.is_valid and blob.area > 4 else base
    elif kind == 5:
        base = affinity.rotate(base, rng.uniform(-20, 20))
    return base


def partition(rng):
    """A footprint over a guillotine partition with a random lower envelope in each cell."""
    width, depth = rng.uniform(5, 25), rng.uniform(5, 15)
    outline = footprint(rng, width, depth)
    boxes = guillotine(
        rng, (-width / 2 - 1, -depth / 2 - 1, width / 2 + 1, depth / 2 + 1), rng.integers(1, 4)
    )
    return roof([Piece(shapely.box(*box), random_planes(rng, box)) for box in boxes], outline)


def cross_gables(rng):
    """Overlapping gables in the form of a cross, T or L, over their union."""
    pieces = []
    for degrees in (0.0, 90.0, rng.uniform(0, 180))[: rng.integers(2, 4)]:
        x, y = rng.uniform(-3, 3, 2)
        length, width, z = rng.uniform(8, 20), rng.uniform(4, 8), rng.uniform(6, 9)
        pieces.append(
            Piece(
                rectangle(x, y, length, width, degrees),
                gable_planes(x, y, z, rng.uniform(0.3, 1.2), degrees),
            )
        )
    return roof(pieces, shapely.union_all([piece.outline for piece in pieces]))


def row_house(rng):
    """A gable or hip cut out of a long row by a slightly turned slice that leaves strips the piece
    does not cover.
    """
    pieces = [Piece(rectangle(0, 0, 40, 9), gable_planes(0, 0, 9, rng.uniform(0.4, 1.2), 0))]
    pieces.append(Piece(rectangle(0, 6.5, 5, 4), random_planes(rng, (-2, 5, 2, 8))))
    return roof(
        pieces, rectangle(0, rng.uniform(-0.5, 2), 6, 10 + rng.uniform(0, 2), rng.uniform(-3, 3))
    )


def saw_tooth(rng):
    """Parallel monopitches as pieces of one part."""
    teeth, step, slope = int(rng.integers(2, 8)), rng.uniform(1.5, 5), rng.uniform(0.2, 1.0)
    boxes = [shapely.box(k * step, 0, (k + 1) * step, 12) for k in range(teeth)]
    pieces = tuple(
        Piece(box, np.array([[slope, 0, 5 - slope * k * step]])) for k, box in enumerate(boxes)
    )
    return Roof((Part("shed", pieces),), shapely.box(0, 0, teeth * step, 12), FRAME)


def steps(rng):
    """Flat levels side by side and in a checkerboard, a centimetre to ten metres apart."""
    rows, columns = rng.integers(1, 4, 2)
    pieces = []
    for i in range(rows):
        for j in range(columns):
            z = 5 + rng.choice([0, 0.0005, 0.001, 0.002, 0.01, 0.1, 1, 10])
            pieces.append(
                Piece(shapely.box(4 * i, 3 * j, 4 * i + 4, 3 * j + 3), np.array([[0.0, 0, z]]))
            )
    return roof(pieces, shapely.box(0, 0, 4 * rows, 3 * columns))


def nearly(rng):
    """Pieces whose edges miss the outline and one another by less than a centimetre."""
    outline = footprint(rng, 12, 8)
    pieces = []
    for box in guillotine(rng, (-6, -4, 6, 4), 2):
        shifted = np.array(box) + rng.choice(
            [0, 1e-5, 1e-4, 5e-4, 9e-4, 1.5e-3, 4e-3, 9e-3], 4
        ) * rng.choice([-1, 1], 4)
        turned = affinity.rotate(shapely.box(*shifted), rng.choice([0, 0.005, 0.05, 0.3]))
        pieces.append(Piece(turned, random_planes(rng, box)))
    return roof(pieces, outline)


def towers(rng):
    """A lower roof with towers and dormers strewn over it, touching corners now and then."""
    outline = footprint(rng, 16, 12)
    pieces = [Piece(shapely.box(-9, -9, 9, 9), random_planes(rng, (-3, -3, 3, 3)) - [[0, 0, 4]])]
    for _ in range(rng.integers(1, 6)):
        x, y = np.round(rng.uniform(-6, 6, 2))
        box = rectangle(
            x, y, rng.integers(1, 5), rng.integers(1, 5), rng.choice([0, 0, 45, rng.uniform(0, 90)])
        )
        pieces.append(Piece(box, random_planes(rng, (x - 1, y - 1, x + 1, y + 1))))
    return roof(pieces, outline)


def off_by_little(rng, value):
    """`value` or something a tenth of a millimetre to two centimetres beside it."""
    return value + rng.choice(
        [0, 0, 1e-4, 3e-4, 6e-4, 1e-3, 1.5e-3, 3e-3, 6e-3, 1e-2, 2e-2]
    ) * rng.choice([-1, 1])


def draw_planes(rng, x, y, length, width, degrees, z):
    """A flat, monopitch, gable, hip, mansard or cut gable with eaves at `z` over a rectangle."""
    slope = rng.choice([0.2, 0.5, 0.84, 1.2, 2.75, rng.uniform(0.1, 2.5)])
    sides = gable_planes(x, y, z + slope * width / 2, slope, degrees)
    kind = rng.integers(6)
    if kind == 0:
        return np.array([[0.0, 0.0, z]])
    if kind == 3:
        end = slope if rng.random() < 0.5 else rng.uniform(0.2, 2.5)
        return np.vstack((sides, gable_planes(x, y, z + end * length / 2, end, degrees + 90)))
    if kind == 4:
        lower, upper = (
            gable_planes(x, y, z + rise, s, degrees)
            for rise, s in ((1.25 * width, 2.5), (1 + width / 10, 0.2))
        )
        return np.vstack((lower, upper))
    if kind == 5:
        return np.vstack((sides, [[0.0, 0.0, off_by_little(rng, z + slope * width / 4)]]))
    return sides[:kind]


def unions(rng):
    """Roofs on overlapping rectangles of a few directions, whose edges and eaves miss one another
    by millimetres.
    """
    directions = [0.0, 90.0, rng.choice([45.0, 0.01, 0.05, 0.3, rng.uniform(0, 90)])]
    pieces, placed = [], [(np.zeros(2), 0.0, 0.0, 0.0)]
    for _ in range(rng.integers(2, 7)):
        length, width = rng.uniform(3, 14), rng.uniform(2, 8)
        centre, other_length, other_width, degrees = placed[rng.integers(len(placed))]
        along, across = rng.choice([-1, 0, 1], 2) * (other_length - length, other_width - width) / 2
        shift = np.array([off_by_little(rng, along), off_by_little(rng, across)])
        c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
        x, y = centre + np.array([[c, -s], [s, c]]) @ shift
        degrees = float(degrees if rng.random() < 0.6 else rng.choice(directions))
        z = off_by_little(rng, rng.choice([3.0, 3.0, 5.0, rng.uniform(3, 8)]))
        pieces.append(
            Piece(
                rectangle(x, y, length, width, degrees),
                draw_planes(rng, x, y, length, width, degrees, z),
            )
        )
        placed.append((np.array([x, y]), length, width, degrees))
    return roof(pieces, shapely.union_all([piece.outline for piece in pieces]))


KINDS = {
    kind.__name__: kind
    for kind in (partition, cross_gables, row_house, saw_tooth, steps, nearly, towers, unions)
}


def generate_roof(kind, seed):
    """The roof of that kind and seed, turned and shifted by the seed as well."""
    rng = np.random.default_rng([seed, list(KINDS).index(kind)])
    roof = KINDS[kind](rng)
    return move_roof(roof, rng.choice([0, rng.uniform(0, 90)]), rng.uniform(-5, 5, 2))


def move_roof(roof, degrees, shift):
    """The roof turned about the origin, then shifted in the plan."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    turn = np.array([[c, -s], [s, c]])

    def move_polygon(polygon):
        return shapely.transform(polygon, lambda xy: xy @ turn.T + shift)

    def move_piece(piece):
        slopes = piece.planes[:, :2] @ turn.T
        return Piece(
            move_polygon(piece.outline),
            np.column_stack((slopes, piece.planes[:, 2] - slopes @ shift)),
        )

    parts = tuple(Part(part.type, tuple(map(move_piece, part.pieces))) for part in roof.parts)
    return Roof(parts, move_polygon(roof.outline), roof.frame)


def flat_block(outline, z_roof, z_ground, frame=FRAME):
    """A flat roof at `z_roof` over `outline`, and its solid."""
    flat = Roof((Part("flat", (Piece(outline, np.array([[0.0, 0.0, z_roof]])),)),), outline, frame)
    return flat, compose(flat, z_ground)
