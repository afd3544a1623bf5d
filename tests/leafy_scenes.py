"""Simulated scenes with more than buildings in them: a neighbourhood as it is scanned, a forest, a
house under a tree.
"""

import numpy as np
import shapely

from hiproof.simulate import ScanSettings
from hiproof.simulate.flight import join_beams, make_beams, random_swaths
from hiproof.simulate.neighbourhood import neighbourhood
from hiproof.simulate.relief import Plane
from hiproof.simulate.roofs import random_building
from hiproof.simulate.scanner import Scan, returns, scan_scene
from hiproof.simulate.scene import SOURCE_GROUND, SOURCE_TREE, Defects, building_bodies, make_scene
from hiproof.simulate.survey import Flight, survey

GROUND, TREE = SOURCE_GROUND, SOURCE_TREE


def town(density: float = 8.0, seed: int = 5) -> tuple[Scan, list]:
    """A street or two of the demo's neighbourhood, and its lots."""
    lots, terrain = neighbourhood(seed)
    corners = np.array([lot.building.footprint.bounds for lot in lots])
    corner = np.floor(corners[:, :2].min(axis=0)) - 5
    patch = [(corner, corner + (90.0, 50.0))]
    flight = Flight(heading=1.2, origin=corner - 250.0)
    (cloud,) = survey(patch, lots, terrain, flight, seed, ScanSettings(density=density))
    members = [
        lot
        for lot in lots
        if shapely.box(*corner, *(corner + (90.0, 50.0))).contains(lot.building.footprint)
    ]
    return cloud, members


def draw_crowns(rng: np.random.Generator, side_m: float, apart_m: float = 5.0) -> np.ndarray:
    """Crowns (t, 5) that cover a square about the origin."""
    steps = np.arange(-side_m / 2, side_m / 2, apart_m)
    x, y = (axis.ravel() + rng.normal(0, 1, axis.size) for axis in np.meshgrid(steps, steps))
    half = rng.uniform(2.5, 5.0, len(x))
    return np.column_stack(
        [x, y, rng.uniform(3, 8, len(x)) + half, rng.uniform(2.5, 4.0, len(x)), half]
    )


def forest(rng: np.random.Generator, side_m: float = 60.0, density: float = 8.0) -> Scan:
    """Trees on a gentle slope and nothing else."""
    scene = make_scene([], draw_crowns(rng, side_m), Plane(0.05, 0.02, 0.0))
    area = shapely.box(*[-side_m / 2] * 2, *[side_m / 2] * 2)
    return scan_scene(scene, area, 8.0, rng, ScanSettings(density=density, defects=Defects.none()))


def make_house_under_tree(rng: np.random.Generator, share: float, density: float = 10.0):
    """A gable house on a lawn, `share` of it under crowns; the scan and the building."""
    building = random_building(rng, "gable", kappa=0.0)
    x0, y0, x1, y1 = building.outline.bounds
    crowns = draw_crowns(rng, 60.0, 3.0)
    crowns[:, 2] += 6.0
    covered = x0 + share * (x1 - x0) - 1.0
    is_near = (
        (crowns[:, 0] > x0 - 6)
        & (crowns[:, 0] < covered - 2)
        & (crowns[:, 1] > y0 - 5)
        & (crowns[:, 1] < y1 + 5)
    )
    scene = make_scene(building_bodies(building), crowns[is_near])
    area = shapely.box(x0 - 20, y0 - 20, x1 + 20, y1 + 20)
    cloud = scan_scene(scene, area, 6.0, rng, ScanSettings(density=density, defects=Defects.none()))
    return cloud.move(building.roof.frame.origin), building


def drone(rng: np.random.Generator, type: str = "gable", density: float = 300.0):
    """A house on a lawn from a drone: dense, and seen from all sides so that its walls are full of
    points.
    """
    building = random_building(rng, type)
    x0, y0, x1, y1 = building.outline.bounds
    swaths = random_swaths(rng, density, 0.9, 0.0, 0.0, 30.0)
    beams = join_beams([make_beams(rng, swath, np.zeros(2), 30.0, 4.0) for swath in swaths])
    settings = ScanSettings(
        density=density, range_noise_m=0.015, horizontal_noise_m=0.015, beam_radius_m=0.02
    )
    cloud = returns(make_scene(building_bodies(building)), beams, rng, settings)
    inside = shapely.contains_xy(
        shapely.box(x0 - 8, y0 - 8, x1 + 8, y1 + 8), *cloud.points[:, :2].T
    )
    return cloud.select(inside).move(building.roof.frame.origin), building
