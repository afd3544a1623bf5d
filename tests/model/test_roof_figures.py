"""Figures of a solid against pencil and paper, and against a slow oracle on random roofs."""

import numpy as np
import pytest
import shapely

from handmade import box, courtyard, gable_house, prism
from hiproof.model import GROUND, ROOF, WALL, Face, Solid
from hiproof.model.roof_figures import roof_figures


def hip_house():
    """10 x 16 m, eaves at 4, ridge at 8 m from y = 5 to 11."""
    xyz = [(x, y, z) for z in (0, 4) for x, y in ((0, 0), (10, 0), (10, 16), (0, 16))] + [
        (5, 5, 8),
        (5, 11, 8),
    ]
    roof = [(4, 5, 8), (5, 6, 9, 8), (6, 7, 9), (7, 4, 8, 9)]
    walls = [(i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4) for i in range(4)]
    faces = [
        Face(((3, 2, 1, 0),), GROUND),
        *(Face((r,), ROOF) for r in roof),
        *(Face((w,), WALL) for w in walls),
    ]
    return Solid(np.array(xyz, float), tuple(faces))


def two_levels():
    """A quarter of the roof at 3 m, three quarters at 6 m (only the faces that the figures of a
    roof need).
    """
    lower = prism([[(0, 0), (1, 0), (1, 4), (0, 4)]], 0, 3)
    upper = prism([[(1, 0), (4, 0), (4, 4), (1, 4)]], 0, 6)
    shifted = [Face(tuple(tuple(i + 8 for i in r) for r in f.rings), f.kind) for f in upper.faces]
    return Solid(np.vstack([lower.vertices, upper.vertices]), lower.faces + tuple(shifted))


@pytest.mark.parametrize(
    "solid, volume, h_50p, h_70p, h_ridge, roofer_type",
    [
        (box(), 60.0, 3.0, 3.0, np.nan, "horizontal"),
        (courtyard(), 420.0, 5.0, 5.0, np.nan, "horizontal"),
        (gable_house(), 480.0, 5.0, 3 + 4 * 0.7, 7.0, "slanted"),
        (two_levels(), 84.0, 6.0, 6.0, np.nan, "multiple horizontal"),
    ],
    ids=["box", "courtyard", "gable", "two levels"],
)
def test_pencil_and_paper(solid, volume, h_50p, h_70p, h_ridge, roofer_type):
    figures = roof_figures(solid)
    got = [figures.volume_m3, figures.h_50p, figures.h_70p, figures.h_ridge]
    np.testing.assert_allclose(got, [volume, h_50p, h_70p, h_ridge], atol=1e-9)
    assert figures.roofer_type == roofer_type


def test_a_courtyard_counts_its_hole():
    assert roof_figures(courtyard()).plan_area_m2 == pytest.approx(100 - 16)


def test_slopes_and_azimuths_of_a_hip():
    figures = roof_figures(hip_house())
    slopes, azimuths = figures.face_slope_deg[1:5], figures.face_azimuth_deg[1:5]
    np.testing.assert_allclose(slopes, np.degrees(np.arctan([4 / 5, 4 / 5, 4 / 5, 4 / 5])))
    np.testing.assert_allclose(azimuths, [180, 90, 0, 270], atol=1e-9)
    assert np.isnan(figures.face_slope_deg[[0, 5, 6, 7, 8]]).all()
    assert figures.h_ridge == 8.0


def test_a_valley_is_no_ridge():
    solid = gable_house(eave=7.0, ridge=3.0)
    assert np.isnan(roof_figures(solid).h_ridge)


@pytest.mark.parametrize("width", [0.1, 1 / 3, 7.7])
def test_half_the_roof_at_a_level_is_enough_for_it(width):
    lower = prism([[(0, 0), (width, 0), (width, 4), (0, 4)]], 0, 3)
    upper = prism([[(0, 0), (width, 0), (width, 4), (0, 4)]], 0, 6)
    faces = lower.select_faces(ROOF) + tuple(
        Face(tuple(tuple(i + 8 for i in r) for r in f.rings), ROOF)
        for f in upper.select_faces(ROOF)
    )
    for order in (faces, faces[::-1]):
        assert roof_figures(Solid(np.vstack([lower.vertices, upper.vertices]), order)).h_50p == 3.0


@pytest.mark.parametrize("seed", range(8))
def test_percentiles_match_a_fine_grid(seed):
    rng = np.random.default_rng(seed)
    width, length, eave = rng.uniform(4, 20, 3)
    solid = gable_house(width, length, eave, eave + rng.uniform(0.1, 9))
    solid = [solid, hip_house()][seed % 2].move(rng.uniform(-1e6, 1e6, 3) * [1, 1, 1e-3])
    figures = roof_figures(solid)
    z, area = sample_roof(solid, 200)
    order = np.argsort(z)
    share = np.cumsum(area[order]) / area.sum()
    for level, want in ((figures.h_50p, 0.5), (figures.h_70p, 0.7)):
        assert level == pytest.approx(z[order][np.searchsorted(share, want)], abs=0.06)
    assert figures.plan_area_m2 == pytest.approx(area.sum(), rel=1e-6)


def sample_roof(solid, steps):
    """Slow oracle: heights and areas of many small cells of every roof face."""
    heights, areas = [], []
    for face in solid.select_faces(ROOF):
        xyz = solid.vertices[list(face.rings[0])]
        plane = np.linalg.lstsq(
            np.c_[xyz[:, :2] - xyz[0, :2], np.ones(len(xyz))], xyz[:, 2], rcond=None
        )[0]
        polygon = shapely.Polygon(xyz[:, :2])
        x0, y0, x1, y1 = polygon.bounds
        x = x0 + (np.arange(steps) + 0.5) * (x1 - x0) / steps
        y = y0 + (np.arange(steps) + 0.5) * (y1 - y0) / steps
        xx, yy = (g.ravel() for g in np.meshgrid(x, y))
        inside = shapely.contains_xy(polygon, xx, yy)
        z = plane[0] * (xx[inside] - xyz[0, 0]) + plane[1] * (yy[inside] - xyz[0, 1]) + plane[2]
        heights.append(z)
        areas.append(np.full(len(z), polygon.area / len(z)))
    return np.concatenate(heights), np.concatenate(areas)


def test_many_levels_are_searched_exactly():
    """A staircase of many levels: its percentiles are steps 350 and 490 of 700."""
    steps = 700
    vertices = [
        (x + dx, y, x * 0.01) for x in range(steps) for dx, y in ((0, 0), (1, 0), (1, 1), (0, 1))
    ]
    faces = tuple(Face((tuple(range(4 * i, 4 * i + 4)),), ROOF) for i in range(steps))
    figures = roof_figures(Solid(np.array(vertices, float), faces))
    assert figures.h_50p == pytest.approx(3.49)
    assert figures.h_70p == pytest.approx(4.89)


@pytest.mark.parametrize("shift", [(0, 0, 0), (1e7, -1e7, 0), (85000, 446000, -6)])
def test_figures_move_with_the_solid(shift):
    first = roof_figures(hip_house())
    second = roof_figures(hip_house().move(np.array(shift, float)))
    for name in ("h_min", "h_50p", "h_70p", "h_max", "h_ridge", "h_base"):
        assert getattr(second, name) - shift[2] == pytest.approx(getattr(first, name), abs=1e-6)
    for name in ("volume_m3", "plan_area_m2", "roof_area_m2", "slope_deg", "azimuth_deg"):
        assert getattr(second, name) == pytest.approx(getattr(first, name), rel=1e-6)


@pytest.mark.parametrize("top", [2.37151, 2.37155, 9.99996])
def test_eaves_of_a_level_roof_are_at_its_height(top):
    """The eave's height is rounded to choose it, about the middle of the solid: it stood a tenth of
    a millimetre above the roof.
    """
    for base in (0.0, 0.01234, -3.33335):
        figures = roof_figures(prism([[(0, 0), (4, 0), (4, 5), (0, 5)]], base, top))
        assert figures.h_min <= figures.h_eave <= figures.h_max
