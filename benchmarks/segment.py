"""The network, the fit and both together.

Roofs are simulated, scanned and real. Run it by `python -m benchmarks.segment [--quick]`.

Writes `benchmarks/segment.md` and the confusion matrices in `benchmarks/figures/`. `--calibrate`
prints instead how the exponents of `hiproof.segment.combine` change the accuracy. Real data are
read from ../shared/data where they exist.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hiproof import reconstruct
from hiproof.errors import FitError
from hiproof.evaluate.distance import point_surface_distances
from hiproof.fit import fit_roof
from hiproof.geometry.rings import ring_normal
from hiproof.learn.data import POINTS, as_sample
from hiproof.learn.shapes import Shape, read_shapes
from hiproof.model import ROOF
from hiproof.segment import combine, segment
from hiproof.segment.inference import SHIPPED_WEIGHTS
from hiproof.segment.scores import Scores
from hiproof.settings import Settings
from hiproof.simulate import ROOF_TYPES, ScanSettings, scan_solids, training_sample

TYPES = ROOF_TYPES
THREE = ("gable", "hip", "pyramid")
TEST_SEED = 2024
DATA = Path(__file__).parents[1] / ".." / "shared" / "data"
HERE = Path(__file__).parent
SAME_CODE = {"asymmetric_gable": "gable"}
"""CityGML's list has one code for both gables; RoofN3D and The Hague call both gable."""


@dataclass
class Tally:
    """Truths and answers of many buildings, by method, as indices of TYPES."""

    truth: list[int] = field(default_factory=list)
    told: dict[str, list[int]] = field(default_factory=dict)

    def add(self, truth: str, **answers: str | None) -> None:
        self.truth.append(TYPES.index(truth))
        for method, answer in answers.items():
            self.told.setdefault(method, []).append(
                TYPES.index(answer) if answer in TYPES else len(TYPES)
            )

    def scores(self, method: str) -> Scores:
        return Scores.of(np.array(self.truth), np.array(self.told[method]), (*TYPES, "none"))


@dataclass(frozen=True)
class Opinion:
    """The answers of network and fit on one building.

    `bics` are of the fit to the points the network calls roof.
    """

    network: dict[str, float]
    bics: dict[str, float]
    points: int
    fit_alone: str | None

    @property
    def combined(self) -> str:
        return next(iter(combine(self.network, self.bics, self.points)))

    @property
    def network_alone(self) -> str:
        return max(self.network, key=self.network.get)


def collect_opinion(points: np.ndarray, types: tuple[str, ...] = TYPES) -> Opinion:
    """Collect the answers of the network alone, the fit alone, and both.

    The fit alone takes all points; the evidence is that of the fit to the network's roof points.
    """
    recognition = segment(points, Settings().replace({"fit": {"types": types}}))
    from_all, informed = fit_or_none(points, types), fit_or_none(points, types, recognition.weights)
    bics, n_used = (informed.bics, informed.points_used) if informed else ({}, 0)
    return Opinion(recognition.types, bics, n_used, from_all.type if from_all else None)


def fit_or_none(points: np.ndarray, types: tuple[str, ...], weights: np.ndarray | None = None):
    try:
        return fit_roof(
            points, settings=Settings.from_dict({"fit": {"types": types}}), weights=weights
        )
    except FitError:
        return None


def judge_three_types(count: int) -> tuple[str, Scores, Scores]:
    """Judge the paper's configuration: pyramid, gable, hip.

    Clouds are simulated with all defects, with labels of every point.
    """
    true_points, told_points, tally = [], [], Tally()
    allowed = Settings().replace({"fit": {"types": THREE}})
    for index in range(count):
        points, labels, type = training_sample(np.random.default_rng([TEST_SEED, 3, index]), THREE)
        recognition = segment(points, allowed)
        tally.add(THREE[type], network=recognition.type)
        true_points.append(labels)
        allowed_index = np.array([THREE.index(name) if name in THREE else 0 for name in TYPES])
        told_points.append(
            np.where(recognition.is_roof, allowed_index[recognition.labels], len(THREE))
        )
    types = tally.scores("network")
    of_points = Scores.of(
        np.concatenate(true_points), np.concatenate(told_points), (*THREE, "not_roof")
    )
    text = make_table(
        ("measure", "reached", "to reach"),
        [
            ("accuracy", format_percent(types.accuracy), "98"),
            ("balanced accuracy", format_percent(types.balanced_accuracy), "97"),
            ("lowest recall", format_percent(types.lowest_recall), "95"),
            ("mean IoU of point labels", format_percent(of_points.mean_iou), "85"),
        ],
    )
    return text, types, of_points


def judge_all_types(
    count: int, densities: tuple[float, ...] = (2.0, 5.0, 10.0)
) -> tuple[str, dict[float, Tally]]:
    """Judge network, fit and combination on all types with all defects.

    There are `count` buildings a density.
    """
    rows, tallies = [], {}
    for density in densities:
        tally = Tally()
        for truth, points in simulate_samples(count, density):
            opinion = collect_opinion(points)
            tally.add(
                truth,
                network=opinion.network_alone,
                fit=opinion.fit_alone,
                combined=opinion.combined,
            )
        tallies[density] = tally
        figures = [
            format_percent(tally.scores(method).balanced_accuracy)
            for method in ("network", "fit", "combined")
        ]
        rows.append((f"{density:g}", *figures))
    return make_table(("points/m2", "network alone", "fit alone", "combined"), rows), tallies


def simulate_samples(
    count: int, density: float, seed: int = TEST_SEED
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield (type, points) of `count` buildings at one density.

    All of the scanner's defects are in them.
    """
    for index in range(count):
        rng = np.random.default_rng([seed, int(10 * density), index])
        points, _, type = training_sample(
            rng, TYPES, n_points=(30, 3000), density=(density, density)
        )
        yield TYPES[type], points


DIRECTIONS = {"flat": 0, "monopitch": 1, "gable": 2, "hip": 4, "pyramid": 4}
"""In how many directions a roof of each type slopes."""


def judge_the_hague(scans: int) -> tuple[str, Tally] | None:
    """Judge held-out shapes of The Hague at 5 points/m2.

    There are `scans` scans a type; all of them count, and those true to their code.
    """
    path = DATA / "denhaag" / "DenHaag_01.city.json"
    if not path.exists():
        return None
    shapes = [shape for shape in read_shapes(path) if shape.held_out and shape.type in DIRECTIONS]
    everything, true_to_code = Tally(), Tally()
    for type in DIRECTIONS:
        of_type = [shape for shape in shapes if shape.type == type]
        for index in range(scans):
            rng = np.random.default_rng([TEST_SEED, 5, index])
            shape = of_type[index % len(of_type)]
            cloud = scan_solids([shape.solid], rng, ScanSettings(density=5.0), [shape.type])
            if len(cloud) < POINTS[0] // 2:
                continue
            opinion = collect_opinion(as_sample(cloud, TYPES, TYPES.index(type), rng).xyz)
            answers = {
                "network": opinion.network_alone,
                "fit": opinion.fit_alone,
                "combined": opinion.combined,
            }
            answers = {method: SAME_CODE.get(answer, answer) for method, answer in answers.items()}
            answers["perfect judge of shapes"] = type if is_true_to_code(shape) else None
            everything.add(type, **answers)
            if is_true_to_code(shape):
                true_to_code.add(type, **answers)
    rows = [
        (
            method,
            *(
                format_percent(tally.scores(method).balanced_accuracy)
                for tally in (everything, true_to_code)
            ),
        )
        for method in everything.told
    ]
    share_kept = np.mean([is_true_to_code(shape) for shape in shapes])
    header = (
        "method",
        "balanced accuracy (combined: 93 to reach)",
        f"on the {format_percent(share_kept)} % true to their code",
    )
    return make_table(header, rows), everything


def is_true_to_code(shape: Shape) -> bool:
    """Return whether a roof slopes in as many directions as its code says.

    Some "monopitch" are level, some "hipped" have a flat top, some pyramids are halved by a wall.
    """
    areas, normals = [], []
    for face in shape.solid.select_faces(ROOF):
        ring = shape.solid.vertices[list(face.rings[0])]
        normal = ring_normal(ring)
        areas.append(np.linalg.norm(normal))
        normals.append(normal / max(areas[-1], 1e-9))
    share, normals = np.array(areas) / np.sum(areas), np.array(normals)
    sloped = np.hypot(*normals[:, :2].T) > np.sin(np.radians(3.0))
    if shape.type == "flat" or not sloped.any():
        return shape.type == "flat" and share[sloped].sum() < 0.1
    azimuth = np.arctan2(normals[:, 1], normals[:, 0])
    quarter = np.rint((azimuth - azimuth[sloped][0]) / (np.pi / 2)).astype(int) % 4
    directions = sum(share[sloped & (quarter == k)].sum() > 0.04 for k in range(4))
    return directions == DIRECTIONS[shape.type] and share[~sloped].sum() < 0.1


def judge_labelled_roofs() -> str | None:
    """Judge the twelve labelled real roofs, never trained on."""
    folder = DATA / "roofn3d" / "labelled"
    if not folder.is_dir():
        return None
    rows, right = [], np.zeros(3, int)
    for path in sorted(folder.glob("*/*.pts")):
        opinion, truth = collect_opinion(np.loadtxt(path)[:, :3]), path.parent.name
        answers = (opinion.network_alone, opinion.fit_alone, opinion.combined)
        right += [SAME_CODE.get(answer, answer) == truth for answer in answers]
        rows.append((f"{truth}/{path.stem}", *answers))
    return make_table(
        ("roof", "network alone", "fit alone", "combined"), [*rows, ("right", *map(str, right))]
    )


def judge_new_york() -> str | None:
    """Judge 392 real roofs through the whole pipeline.

    It is run with and without the network, and measures the distance of their roof points.
    """
    path = DATA / "roofn3d" / "nyc_roofs.npz"
    if not path.exists():
        return None
    data = np.load(path)
    clouds = np.split(data["points"].astype(float), data["offset"][1:-1])
    faces = np.split(data["face"], data["offset"][1:-1])
    rows = []
    for parts in ("one", "compound"):
        for network in ("never", "auto"):
            settings = Settings().replace(
                {"fit": {"parts": parts}, "segment": {"network": network}}
            )
            distances = [
                measure_roof_distance(cloud, face > 0, settings)
                for cloud, face in zip(clouds, faces, strict=True)
            ]
            figures = (np.mean(distances), np.median(distances), np.percentile(distances, 90))
            rows.append(
                (
                    parts,
                    network,
                    *(f"{figure:.4f} m" for figure in figures),
                )
            )
    return make_table(("parts", "network", "mean", "median", "90th percentile"), rows)


def measure_roof_distance(cloud: np.ndarray, is_roof: np.ndarray, settings: Settings) -> float:
    """Return the mean distance of a roof's points to its reconstruction.

    NaN counts as 1 m.
    """
    solid = reconstruct(cloud, settings=settings).solid
    if solid is None:
        return 1.0
    rings = [
        [solid.vertices[list(ring)] for ring in face.rings] for face in solid.select_faces(ROOF)
    ]
    return float(point_surface_distances(cloud[is_roof], rings).mean())


def measure_speed() -> str:
    """Measure the time of recognising on one core, and the weights' size.

    It is timed for types alone, as a compound fit needs them, and with the points' labels.
    """
    rows = []
    for count in (300, 700, 1500):
        points = training_sample(
            np.random.default_rng(0), n_points=(count, count), density=(5.0, 5.0)
        )[0]
        types, labels = (
            1000 * measure_processor_time(road, points)
            for road in (segment, lambda points: segment(points).labels)
        )
        rows.append((f"types, {count} points, one core", f"{types:.1f} ms", ""))
        rows.append(
            (
                f"types and labels, {count} points, one core",
                f"{labels:.1f} ms",
                "10 ms" if count == 300 else "",
            )
        )
    megabytes = SHIPPED_WEIGHTS.stat().st_size / 1e6
    rows.append(("shipped weights", f"{megabytes:.2f} MB", "8 MB"))
    return make_table(("measure", "reached", "to reach"), rows)


def measure_processor_time(
    road: Callable[[np.ndarray], object], points: np.ndarray, repeats: int = 100
) -> float:
    """Return the median processor time (s) of a call, after a first one."""
    times = []
    for _ in range(repeats + 1):
        start = time.process_time()
        road(points)
        times.append(time.process_time() - start)
    return float(np.median(times[1:]))


def calibrate(count: int) -> None:
    """Print the combination's balanced accuracy over exponents.

    They are those of the evidence, on buildings of another seed.
    """
    for density in (1.0, 2.0, 5.0, 10.0):
        opinions = [
            (truth, collect_opinion(points))
            for truth, points in simulate_samples(count, density, TEST_SEED + 1)
        ]
        truth = np.array([TYPES.index(name) for name, _ in opinions])
        line = []
        for exponent in (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 1.0):
            types = [
                next(iter(combine(o.network, o.bics, o.points, exponent))) for _, o in opinions
            ]
            scores = Scores.of(truth, np.array([TYPES.index(name) for name in types]), TYPES)
            line.append(f"{exponent:g}: {format_percent(scores.balanced_accuracy)}")
        print(f"{density:g} points/m2  " + "  ".join(line), flush=True)


def make_table(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """Return a Markdown table."""
    lines = [
        "| " + " | ".join(map(str, row)) + " |" for row in (header, ["---"] * len(header), *rows)
    ]
    return "\n".join(lines)


def format_percent(share: float) -> str:
    return f"{100 * share:.1f}"


def draw_confusion(scores: Scores, title: str, name: str) -> None:
    """Draw a confusion matrix as PNG.

    Rows are the truth, in percent of the truth.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    used_types = np.flatnonzero(scores.confusion.sum(axis=0) + scores.confusion.sum(axis=1))
    names = [scores.names[i].replace("_", " ") for i in used_types]
    counts = scores.confusion[np.ix_(used_types, used_types)]
    shares = 100 * counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    figure = Figure(
        figsize=(1.8 + 0.62 * len(used_types), 1.6 + 0.56 * len(used_types)), layout="constrained"
    )
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.imshow(shares, cmap="Blues", vmin=0, vmax=100)
    for (row, column), share in np.ndenumerate(shares):
        if counts[row, column]:
            axes.text(
                column,
                row,
                f"{share:.1f}",
                ha="center",
                va="center",
                color="w" if share > 50 else "k",
                fontsize=8,
            )
    axes.set_xticks(range(len(names)), names, rotation=50, ha="right")
    axes.set_yticks(range(len(names)), names)
    axes.set(xlabel="told", ylabel="true", title=title)
    (HERE / "figures").mkdir(exist_ok=True)
    figure.savefig(HERE / "figures" / f"{name}.png", dpi=110)


def main() -> None:
    """Run everything and write the report; parts without data are left out."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a tenth of the buildings")
    parser.add_argument(
        "--calibrate", action="store_true", help="print accuracies over the exponents and stop"
    )
    arguments = parser.parse_args()
    scale = 10 if arguments.quick else 1
    if arguments.calibrate:
        calibrate(500 // scale)
        return
    parts = [
        "# Recognising roofs",
        "Written by `python -m benchmarks.segment`. Figures in percent unless they have a unit.",
    ]
    text, types, points = judge_three_types(1500 // scale)
    draw_confusion(types, "three types, simulated: buildings", "segment_three_types")
    draw_confusion(points, "three types, simulated: points", "segment_three_types_points")
    parts += [
        "## Three types, simulated with all defects, network alone",
        text,
        describe_recalls(types),
    ]
    text, tallies = judge_all_types(600 // scale)
    for method in ("network", "fit", "combined"):
        draw_confusion(
            tallies[5.0].scores(method),
            f"all types, 5 points/m2: {method}",
            f"segment_all_types_{method}",
        )
    parts += [
        "## All types, simulated with all defects: balanced accuracy (combined, 96 to reach at 5)",
        text,
    ]
    parts += [describe_recalls(tallies[5.0].scores("combined"))]
    name = judge_the_hague(150 // scale)
    if name:
        draw_confusion(
            name[1].scores("combined"), "The Hague, 5 points/m2: combined", "segment_the_hague"
        )
        parts += [
            "## The Hague's held-out shapes, 5 points/m2",
            name[0],
            describe_recalls(name[1].scores("combined")),
        ]
    for title, text in (
        (
            "Twelve labelled real roofs (an asymmetric gable counts as gable)",
            judge_labelled_roofs(),
        ),
        (
            "392 New York roofs through the pipeline: distance of roof points",
            None if arguments.quick else judge_new_york(),
        ),
        ("Speed and size", measure_speed()),
    ):
        parts += [f"## {title}", text] if text else []
    report = "\n\n".join(parts) + "\n"
    print(report)
    if not arguments.quick:
        (HERE / "segment.md").write_text(report)


def describe_recalls(scores: Scores) -> str:
    """Describe the recall of every type that occurs, as one sentence."""
    return (
        "Recall: "
        + ", ".join(f"{name} {format_percent(recall)}" for name, recall in scores.recalls.items())
        + "."
    )


if __name__ == "__main__":
    main()
