"""One primitive fitted to points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..frames import LocalFrame
from .roof import Part, Roof


@dataclass(frozen=True)
class Fit:
    """One primitive fitted to points: the outcome of `fit_roof`.

    `parameters` theta_p by name in metres, `kappa` rad, `translation` T_L (3,) relative to
    `global_translation` T_G (3,), `sigma` standard deviations by name (parameters, "kappa", "t_x",
    "t_y", "t_z") where points tell them, `bic` of the chosen type and `bics` of every type tried
    (lower is better), `value` the objective at the optimum. `vertices` (n, 3) and `faces` (vertex
    indices, counter-clockwise from above) are the roof surfaces in the frame of the points given.
    """

    type: str
    parameters: dict[str, float]
    kappa: float
    translation: np.ndarray
    global_translation: np.ndarray
    sigma: dict[str, float]
    objective: str
    value: float
    bic: float
    bics: dict[str, float]
    points_used: int
    noise_m: float
    outlier_share: float
    evaluations: int
    part: Part
    vertices: np.ndarray
    faces: tuple[tuple[int, ...], ...]

    def height_at(self, xy: np.ndarray) -> np.ndarray:
        """Return the roof height (n,) at `xy` (n, 2) in the points' frame, NaN outside."""
        frame = LocalFrame(self.global_translation)
        roof = Roof((self.part,), self.part.pieces[0].outline, frame)
        return roof.height_at(frame.to_local(np.asarray(xy, float))) + self.global_translation[2]
