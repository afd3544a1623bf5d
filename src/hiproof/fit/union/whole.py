"""Hold a whole large roof: points, outline, and the volumes found so far.

The search of a large roof never looks at all of it at once. It opens windows (`window.py`), and
what a window needs of the roof is here, sorted so that its cost depends on the window alone.
"""

from __future__ import annotations

import numpy as np
import shapely

from .box import EMPTY_BOX, Box, clip_to_box, measure_box
from .plan import Plan
from .scene import Scene
from .volumes import (
    DIRECTION,
    LEVEL,
    OFFSET0,
    REPLACES,
    ROW_NUMBER,
    U0,
    U1,
    UNSORTED,
    V0,
    V1,
    compute_roof_heights,
    make_base,
)

# Distance (m) of the base below the lowest point of a roof searched in windows: no window moves it,
# and it is never visible.
BELOW_ALL_M = 1.0
POSITION = slice(DIRECTION, V1 + 1)  # Columns of a volume that give its place.


class Whole:
    """The roof of one large building while its windows are searched.

    `scene` is that of all points. `u`, `v`, `z` (n,) are the points, ascending by u, and `outline`
    is in the plan's axes. `volumes` (k, COLUMNS) hold their own row's number in the column
    ROW_NUMBER.
    """

    def __init__(
        self, scene: Scene, plan: Plan, outline: shapely.Polygon, volumes: np.ndarray | None = None
    ):
        self.scene, self.plan = scene, plan
        order = scene.order[0, 0]
        order = order[order < scene.n]
        self.order = order
        self.u, self.v, self.z = scene.U[0][order], scene.V[0][order], scene.z[order]
        self.outline = shapely.transform(
            outline, lambda xy: (xy - plan.frame.origin[:2]) @ plan.frame.rotation.T
        )
        self.box, self.area = measure_box(self.outline), outline.area
        self.extents: dict[bytes, Box] = {}
        self.volumes = (
            make_base(float(self.z.min()) - BELOW_ALL_M) if volumes is None else volumes.copy()
        )
        self.set_volumes(self.volumes)

    def set_volumes(self, volumes: np.ndarray, boxes: np.ndarray | None = None) -> None:
        """Set the volumes, and the boxes (k, 4) around them if known.

        Each is numbered by its row.
        """
        self.volumes, self.boxes = volumes, self.find_extents(volumes) if boxes is None else boxes
        self.volumes[:, ROW_NUMBER] = np.arange(len(volumes))

    def find_extents(self, rows: np.ndarray) -> np.ndarray:
        """Return the boxes (k, 4) around what lies inside the outline of volumes."""
        return np.array([self.find_extent(row) for row in rows]).reshape(-1, 4)

    def find_points(self, box: Box) -> np.ndarray:
        """Return the numbers (m,) of the points in a box, among those sorted by u."""
        first, last = np.searchsorted(self.u, box.u0), np.searchsorted(self.u, box.u1, side="right")
        v = self.v[first:last]
        return first + np.flatnonzero((v >= box.v0) & (v <= box.v1))

    def find_extent(self, row: np.ndarray) -> Box:
        """Return the box around what lies inside the outline of a volume's rectangle."""
        key = row[POSITION].tobytes()
        if key not in self.extents:
            self.extents[key] = self.measure_extent(row)
        return self.extents[key]

    def measure_extent(self, row: np.ndarray) -> Box:
        rectangle = Box(*row[[U0, U1, V0, V1]].tolist())
        if rectangle.u0 >= rectangle.u1 or rectangle.v0 >= rectangle.v1:
            return EMPTY_BOX
        if row[DIRECTION] == 0:
            return measure_box(clip_to_box(self.outline, rectangle))
        c, s = self.scene.turn[int(row[DIRECTION])]
        u, v = row[[U0, U1, U1, U0]], row[[V0, V0, V1, V1]]
        turned = shapely.Polygon(np.column_stack([c * u - s * v, s * u + c * v]))
        clipped = clip_to_box(self.outline, measure_box(turned))
        return (
            measure_box(shapely.intersection(shapely.make_valid(clipped), turned))
            if not clipped.is_empty
            else EMPTY_BOX
        )

    def list_volumes(self, box: Box) -> list[int]:
        """Return the numbers of the volumes, but the base, that reach into a box."""
        e = self.boxes
        is_reaching = (
            (e[:, 0] < box.u1) & (e[:, 1] > box.u0) & (e[:, 2] < box.v1) & (e[:, 3] > box.v0)
        )
        return [k for k in np.flatnonzero(is_reaching).tolist() if k > 0]

    def select_rows(self, box: Box) -> np.ndarray:
        """Return the base, and the volumes that reach into a box."""
        return self.volumes[[0, *self.list_volumes(box)]]

    def replace(self, numbers: list[int], rows: np.ndarray) -> None:
        """Put `rows` in place of the volumes numbered `numbers`.

        A row keeps its place in the order by its number; a new row (number 0) follows the row
        before it.
        """
        kept_numbers = np.delete(np.arange(len(self.volumes)), numbers)
        places, last = [], 0.0
        for number in rows[:, ROW_NUMBER].tolist() if len(rows) else []:
            last = max(last + 1e-6, number)
            places.append(last)
        if not numbers:
            places = [len(self.volumes) + k for k in range(len(rows))]
        all_rows = np.concatenate([self.volumes[kept_numbers], rows])
        boxes = np.concatenate([self.boxes[kept_numbers], self.find_extents(rows)])
        order = np.argsort(np.concatenate([kept_numbers, places]), kind="stable")
        self.set_volumes(all_rows[order], boxes[order])

    def find(self, place: bytes) -> int | None:
        """Find the number of the volume at a place, None if it is gone.

        A place is the bytes of the columns POSITION.
        """
        is_there = (self.volumes[1:, POSITION] == np.frombuffer(place)).all(axis=1)
        return 1 + int(is_there.argmax()) if is_there.any() else None

    def compute_heights(self) -> np.ndarray:
        """Return heights (n,) of the roof at all points.

        Each volume is evaluated only where it lies.
        """
        z = np.full(len(self.u), self.volumes[0, OFFSET0 + LEVEL])
        c, s = self.scene.turn[:, :1], self.scene.turn[:, 1:]
        for k in range(1, len(self.volumes)):
            i = self.find_points(Box(*self.boxes[k]))
            u, v = self.u[i], self.v[i]
            U, V = c * u + s * v, c * v - s * u
            h, _ = compute_roof_heights(self.volumes[k : k + 1], U, V, UNSORTED)
            is_higher = (h > z[i]) | ((self.volumes[k, REPLACES] > 0) & np.isfinite(h))
            z[i[is_higher]] = h[is_higher]
        return z
