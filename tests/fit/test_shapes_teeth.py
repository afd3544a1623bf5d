"""Check saw-teeth: their planes determine their width, and nothing is left bare."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from benchmarks.compounds import draw_compound

from hiproof.fit.roof import fit_building
from hiproof.fit.shapes.regions import unite_outlines
from hiproof.fit.shapes.shown import absorb_slivers
from hiproof.fit.shapes.teeth import unite_saw_teeth
from hiproof.model import Part, Piece
from hiproof.primitives import get
from points_of_roofs import sample_heights

SLOPE, WIDTH, LENGTH, LOW = 0.5, 5.0, 12.0, 4.0  # of every tooth; the height at which each begins


def place_part(name, theta_p, kappa, across, z):
    """Make a part of the catalogue whose middle lies so far `across` the row."""
    shape = get(name)
    place = np.array([-math.sin(kappa) * across + 40.0, math.cos(kappa) * across - 7.0, z])
    return shape.part(shape.to_theta(theta_p, kappa, place))


def make_seen_tooth(number, start, end, kappa):
    """Make the tooth of that number from the row's foot on, from `start` to `end`."""
    size = {"width": end - start, "length": LENGTH, "height": SLOPE * (end - start)}
    return place_part(
        "monopitch", size, kappa, 0.5 * (start + end), LOW + SLOPE * (start - number * WIDTH)
    )


def make_seen_row(count, kappa, rng):
    """Make teeth whose steps are up to 0.2 m off, and the annex behind the last."""
    ends = WIDTH * np.arange(count + 1) + np.r_[0.0, rng.uniform(-0.2, 0.2, count)]
    teeth = [make_seen_tooth(k, *ends[k : k + 2], kappa) for k in range(count)]
    end = count * WIDTH + 6.0
    annex = {"width": end - ends[-1], "length": LENGTH}
    return [*teeth, place_part("flat", annex, kappa, 0.5 * (ends[-1] + end), 3.0)]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("count", [2, 4, 6])
def test_planes_tell_how_wide_teeth_are(count, seed):
    rng = np.random.default_rng(seed)
    parts = make_seen_row(count, rng.uniform(-3.0, 3.0), rng)
    result = {
        part.type: part for part in unite_saw_teeth([parts[k] for k in rng.permutation(len(parts))])
    }
    assert set(result) == {"shed", "flat"}
    assert result["shed"].parameters["width"] == pytest.approx(count * WIDTH, abs=1e-6)
    assert result["shed"].area == pytest.approx(count * WIDTH * LENGTH, abs=1e-3)
    assert result["shed"].translation[2] == pytest.approx(LOW, abs=1e-6)
    assert unite_outlines(list(result.values())).area == pytest.approx(
        (count * WIDTH + 6.0) * LENGTH, abs=1e-3
    )


@pytest.mark.parametrize("kappa", [0.0, 0.7, -2.5])
def test_a_strip_between_teeth_is_no_roof_of_its_own(kappa):
    original, end = (
        make_seen_tooth(0, 0.0, WIDTH - 0.4, kappa),
        make_seen_tooth(1, WIDTH, 2.0 * WIDTH, kappa),
    )
    strip = place_part("flat", {"width": 0.4, "length": LENGTH}, kappa, WIDTH - 0.2, 5.0)
    (shed,) = unite_saw_teeth([original, strip, end])
    assert shed.type == "shed"
    assert shed.area == pytest.approx(2.0 * WIDTH * LENGTH, abs=1e-3)


@pytest.mark.parametrize("kappa", [0.0, 0.7, -2.5])
def test_a_row_with_slanted_ends_and_nothing_beside_it_is_one_saw_tooth(kappa):
    """Its ends are no walls across it.

    What lies beyond the teeth's own width belongs to the outermost teeth.
    """
    c, s, u = math.cos(kappa), math.sin(kappa), 0.5 * LENGTH
    rings = (
        [(-u, -0.3), (u, 0.1), (u, WIDTH), (-u, WIDTH)],
        [(-u, WIDTH), (u, WIDTH), (u, 2 * WIDTH + 0.7), (-u, 2 * WIDTH + 0.3)],
    )
    row = []
    for k, ring in enumerate(rings):
        tooth = make_seen_tooth(k, k * WIDTH, (k + 1) * WIDTH, kappa)
        outline = shapely.Polygon(np.array(ring) @ np.array([[c, s], [-s, c]]) + [40.0, -7.0])
        row.append(replace(tooth, pieces=(Piece(outline, tooth.pieces[0].planes),)))
    (shed,) = unite_saw_teeth(row)
    assert shed.type == "shed"
    assert shed.area == pytest.approx(unite_outlines(row).area, abs=1e-3)
    assert shed.parameters["width"] == pytest.approx(2.0 * WIDTH, abs=1e-6)


def test_wings_beside_a_yard_or_in_a_row_are_two_and_what_crosses_a_roof_is_one():
    def z(x, y):
        return np.where(np.abs(y) < 4.0, 9.0, 6.0)

    across = shapely.union(shapely.box(-12, -4, 12, 4), shapely.box(-3, -11, 3, 11))
    row = shapely.box(-3, -11, 3, 11)
    neighbours = shapely.union_all(
        [shapely.box(-12, -4, 12, 4), shapely.box(-12, 4, -6, 11), shapely.box(6, 4, 12, 11)]
    )
    for outline, count in ((across, 2), (row, 3), (neighbours, 3)):
        parts = fit_building(sample_heights(z, outline), outline).roof_parts
        assert [part.type for part in parts] == ["flat"] * count
        assert sorted(round(part.translation[2], 1) for part in parts) == [6.0] * (count - 1) + [
            9.0
        ]


def test_a_strip_a_grid_step_off_its_neighbour_joins_it():
    flat = [
        (-2.758176, 19.310466),
        (1.171256, 11.801776),
        (-10.364279, 5.765023),
        (-14.293711, 13.273712),
    ]
    strip = [
        (-10.364279, 5.765022),
        (1.171257, 11.801776),
        (1.200482, 11.745931),
        (-10.335054, 5.709177),
    ]
    level = np.array([[0.0, 0.0, 3.0]])
    first, other = (Part("flat", (Piece(shapely.Polygon(ring), level),)) for ring in (flat, strip))
    (part,) = absorb_slivers([first], other, math.inf)
    assert part.area == pytest.approx(first.area + other.area, abs=1e-3)


def test_a_row_that_only_touches_what_it_would_reach_into_is_a_saw_tooth():
    """Two areas that touch have a line in common, and the building failed on it."""
    building, points = draw_compound("saw_tooth_hall", 2.0, 2036)
    fit = fit_building(points, building.outline)
    assert sorted(part.type for part in fit.roof_parts) == ["flat", "shed"]
