"""The shipped network in ONNX Runtime.

`segment` labels a building's points and names its roof type.

The first step of Li, Zhang and Shan (2020): only roof points go on to the fit, with the network's
probabilities as the prior of its choice of type.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FitError, InputError, SettingsError
from ..extras import import_extra
from ..log import count_things
from ..settings import Settings
from .arrange import Arrangement, Layout, arrange
from .posterior import find_nearest_type, softmax
from .sampling import compute_inverse_shares

FORMAT = "hiproof-roof-types-2"
INPUT_NAMES = (
    "features",
    "group1",
    "group2",
    "group3",
    "radii",
    "up_index1",
    "up_index2",
    "up_weight1",
    "up_weight2",
)
OUTPUT_NAMES = ("point_logits", "type_logits")
SHIPPED_WEIGHTS = Path(__file__).parent / "weights" / "roof_types.onnx"
NOT_ROOF = -1  # label of what is no roof
FEWEST_CLOUD_POINTS = 10  # points; fewer fill no neighbourhood
# A roof point left out costs a fit more than a point of a wall left in, which its outliers bear.
SURELY_NOT_ROOF = 0.8
CARRIED_NEIGHBOURS = 3  # sampled points that a point's label is the mean of, as in PointNet++
CARRIED_CHUNK = 200_000  # points labelled at once: memory stays bounded


@dataclass(frozen=True)
class Segmentation:
    """What the network says of one building's n points.

    `types` probability of the building's roof type by name, in the catalogue's order, summing to 1.
    `logits` (m, types + 1), not-roof last, of the m points `sampled` (m, 3) that the network took
    of all points `xyz` (n, 3); what is said of each of the n points is carried over from them when
    it is first asked for.
    """

    types: dict[str, float]
    logits: np.ndarray
    sampled: np.ndarray
    xyz: np.ndarray

    @cached_property
    def of_every_point(self) -> tuple[np.ndarray, np.ndarray]:
        """`labels` and `not_roof`."""
        return carried_back(softmax(self.logits), self.sampled, self.xyz)

    @property
    def labels(self) -> np.ndarray:
        """(n,) index of the point's roof type in `types`' order, -1 where it is no roof."""
        return self.of_every_point[0]

    @property
    def not_roof(self) -> np.ndarray:
        """(n,) probability that the point is no roof."""
        return self.of_every_point[1]

    @property
    def type(self) -> str:
        """The most probable roof type."""
        return max(self.types, key=self.types.__getitem__)

    @property
    def is_roof(self) -> np.ndarray:
        """(n,) True where a point is labelled with a roof type."""
        return self.labels != NOT_ROOF

    @property
    def weights(self) -> np.ndarray:
        """Weight (n,) of each point in a fit: 0 for surely no roof, else 1, and 1 if few remain."""
        mask = self.not_roof < SURELY_NOT_ROOF
        return mask.astype(float) if mask.sum() >= FEWEST_CLOUD_POINTS else np.ones(len(mask))


@dataclass(frozen=True)
class LoadedNetwork:
    """A loaded ONNX network with what its file says of itself."""

    session: Any
    types: tuple[str, ...]
    layout: Layout


def segment(points: np.ndarray, settings: Settings | None = None) -> Segmentation:
    """Label the points of one building, and give its type's probabilities.

    A label is a roof type, or not roof.

    `points` (n, 3) metres, any frame and order, n >= 10; but for rounding, the answer does not
    change when they turn about Z. A cloud beyond the network's size is thinned to farthest points
    and its labels are carried back to all points. Types outside `settings.fit.types` get
    probability 0: the paper's three-type configuration is `("pyramid", "gable", "hip")`.

    Raises FitError for points no roof can be told from (fewer than 10, all in one place, not
    finite), InputError for an array of another shape, for weights that are missing or of another
    kind and without ONNX Runtime (the extra `network`), SettingsError for a device not there.

    >>> x, y = np.meshgrid(np.arange(0, 12, 0.5), np.arange(0, 8, 0.5))
    >>> gable = np.column_stack([x.ravel(), y.ravel(), 6 - 0.7 * abs(y.ravel() - 3.75)])
    >>> segment(gable).type
    'gable'
    """
    settings = settings or Settings()
    xyz = checked_points(points)
    model = load(settings.segment.weights or str(SHIPPED_WEIGHTS), settings.segment.device)
    arranged = arrange(xyz, model.layout)
    point_logits, type_logits = run(model, [arranged])
    classes = {find_nearest_type(name, model.types) for name in settings.fit.types}
    if settings.fit.types and not classes & set(model.types):
        raise SettingsError(
            f"expected fit.types to name types the network knows ({', '.join(model.types)}), got "
            f"{', '.join(settings.fit.types)}"
        )
    barred = np.array(
        [0.0 if not settings.fit.types or name in classes else -np.inf for name in model.types]
    )
    type_probability = softmax(type_logits[0] + barred)
    types = dict(zip(model.types, map(float, type_probability), strict=True))
    logits = point_logits[: arranged.sampled] + np.append(barred, 0.0)
    return Segmentation(types, logits, xyz[arranged.select[: arranged.sampled]], xyz)


def run(model: LoadedNetwork, arrangements: list[Arrangement]) -> tuple[np.ndarray, np.ndarray]:
    """Point logits (B N, types + 1) and type logits (B, types) of arranged buildings."""
    return model.session.run(OUTPUT_NAMES, stack_arrangements(arrangements, model.layout))


def stack_arrangements(arrangements: list[Arrangement], layout: Layout) -> dict[str, np.ndarray]:
    """Return the graph's inputs for B buildings, flat; indices are rows of the level above."""
    of_levels = zip(*((*a.groups, *a.up_indices) for a in arrangements), strict=True)
    above = (layout.points, *layout.levels, layout.levels[0])
    *groups, up1, up2 = (
        np.concatenate([index + i * size for i, index in enumerate(indices)])
        for indices, size in zip(of_levels, above, strict=True)
    )
    weights = map(np.concatenate, zip(*(a.up_weights for a in arrangements), strict=True))
    features = np.concatenate([a.features for a in arrangements])
    radii = np.stack([a.radii for a in arrangements])
    return dict(zip(INPUT_NAMES, (features, *groups, radii, up1, up2, *weights), strict=True))


def carried_back(
    probability: np.ndarray, sampled: np.ndarray, xyz: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Carry labels (n,) and probabilities (n,) back to all points `xyz`.

    They come from the nearest of the `sampled` points. The probability is that of not-roof.
    `probability` (m, types + 1), not-roof last; the mean of the three nearest weighted by inverse
    distance, in pieces, so that memory beyond the result is bounded.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(sampled)
    labels, not_roof = np.empty(len(xyz), np.int64), np.empty(len(xyz))
    for start in range(0, len(xyz), CARRIED_CHUNK):
        piece = slice(start, start + CARRIED_CHUNK)
        distance, index = tree.query(xyz[piece], k=min(CARRIED_NEIGHBOURS, len(sampled)))
        mean = np.einsum("nk,nkc->nc", compute_inverse_shares(distance), probability[index])
        not_roof[piece] = mean[:, -1]
        labels[piece] = np.where(mean[:, -1] > 0.5, NOT_ROOF, mean[:, :-1].argmax(axis=1))
    return labels, not_roof


def checked_points(points: np.ndarray) -> np.ndarray:
    """Return `points` as float64 (n, 3) in a frame of their own; raises as `segment`."""
    xyz = np.asarray(points)
    if xyz.ndim != 2 or xyz.shape[1] < 3 or not np.issubdtype(xyz.dtype, np.number):
        raise InputError(
            f"expected points as an (n, 3) array of numbers, got shape {xyz.shape} of {xyz.dtype}"
        )
    if len(xyz) < FEWEST_CLOUD_POINTS:
        raise FitError(
            f"expected at least {FEWEST_CLOUD_POINTS} points to recognise a roof, got {len(xyz)}; "
            "give the whole building or reconstruct without the network"
        )
    xyz = xyz[:, :3].astype(float)
    finite = np.isfinite(xyz).all(axis=1)
    if not finite.all():
        raise FitError(
            f"expected finite coordinates, got NaN or infinity in {np.sum(~finite)} of {len(xyz)} "
            "points"
        )
    if np.ptp(xyz[:, :2], axis=0).max() < 1e-6:
        raise FitError(
            f"expected points spread over a roof, got {count_things(len(xyz), 'point')} all in one "
            "place"
        )
    return xyz - xyz[0]


@lru_cache(maxsize=4)
def load(weights: str, device: str = "cpu") -> LoadedNetwork:
    """Load the network in `weights`, once a process, on one thread; raises as `segment`."""
    onnxruntime = import_onnxruntime()
    if device == "cuda" and "CUDAExecutionProvider" not in onnxruntime.get_available_providers():
        text = ", ".join(onnxruntime.get_available_providers())
        raise SettingsError(
            "expected a CUDA device for segment.device = 'cuda', but ONNX Runtime here offers "
            f"only {text}; install onnxruntime-gpu or set it to 'cpu'"
        )
    if not Path(weights).is_file():
        raise InputError(
            f"expected the network's weights at {weights}, but there is no such file; install "
            "hiproof again, "
            "name another ONNX file in segment.weights, or reconstruct without the network"
        )
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4
    providers = ["CPUExecutionProvider"]
    if device == "cuda":
        providers.insert(0, "CUDAExecutionProvider")
    try:
        session = onnxruntime.InferenceSession(weights, options, providers=providers)
        metadata = session.get_modelmeta().custom_metadata_map
    except Exception as error:
        raise InputError(
            f"expected an ONNX network in {weights}, got a file ONNX Runtime cannot read "
            f"({str(error).splitlines()[0][:120] if str(error) else type(error).__name__}); "
            "install hiproof again or export the network anew with `hiproof train`"
        ) from error
    if metadata.get("format") != FORMAT:
        raise InputError(
            f"expected an ONNX file of the kind {FORMAT!r} in {weights}, got "
            f"{metadata.get('format', 'another network')!r}; "
            "use a file written by this version's `hiproof train`"
        )
    layout = json.loads(metadata["layout"])
    layout["levels"] = tuple(layout["levels"])
    types = tuple(json.loads(metadata["types"]))
    return LoadedNetwork(session, types, Layout(**layout))


def import_onnxruntime(alternative: str = "") -> Any:
    """Import onnxruntime; InputError without it says how to do without, if that can be."""
    return import_extra("onnxruntime", "network", "recognising roofs", alternative)
