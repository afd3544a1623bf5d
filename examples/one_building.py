"""One building: points of a hip roof in, parameters and a valid solid out."""

import numpy as np

import hiproof
from hiproof.simulate import random_building, uniform_points

rng = np.random.default_rng(4)
truth = random_building(rng, "hip", origin=(85000.0, 446000.0, 2.0))
points = uniform_points(truth, rng, density=5.0, noise=0.05)

fit = hiproof.fit_roof(points)
print(f"{fit.type}, fitted to {fit.points_used} points with {1000 * fit.noise_m:.0f} mm of noise")
for name, value in fit.parameters.items():
    print(
        f"  {name:13s} {value:7.3f} m  +- {fit.sigma[name]:.3f}   truth "
        f"{truth.parameters[name]:7.3f}"
    )

building = hiproof.reconstruct(points)
print(
    f"{building.status.value}; {len(building.solid.faces)} faces, {building.quality.psd_mean:.3f} "
    "m from points to roof"
)
assert not hiproof.check_solid(building.solid)
