"""Table 1: what the network makes of the points: labels (IoU) and roof types (accuracy, balanced accuracy, recalls)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hiproof.primitives import CATALOGUE
from hiproof.simulate import training_sample

from .data import ROOFN3D_TYPES, SHARED
from .output import Options, Result, Table

PUBLISHED = "Published on RoofN3D: see the paper's Table 1; always answering gable is right for 75.4 % of RoofN3D."
TYPES = tuple(CATALOGUE)
UNSEEN = 90_001
"""Added to the seed: training draws with small seeds, so these roofs were never trained on."""


def run(options: Options) -> Result:
    """The shipped network on simulated roofs it never saw, and on the labelled real ones where they are at hand."""
    from hiproof.segment import segment

    rng = np.random.default_rng(options.seed + UNSEEN)
    count = 12 if options.quick else 1000
    truth, answers, label_pairs = [], [], []
    for _ in range(count):
        points, labels, kind = training_sample(rng, TYPES)
        found = segment(points)
        truth.append(TYPES[kind])
        answers.append(best_type(found.types))
        label_pairs.append((labels, np.asarray(found.labels)))
    tables = [label_table(label_pairs), *type_tables("simulated", truth, answers)]
    data = f"{count} simulated roofs never trained on"
    labelled = list(labelled_roofs())
    if labelled:
        truth = [kind for kind, _ in labelled]
        answers = [best_type(segment(points).types) for _, points in labelled]
        tables += type_tables("labelled real roofs", truth, answers)
        data += f", {len(labelled)} labelled RoofN3D roofs"
    return Result("segmentation and roof types", data, tuple(tables), remarks=PUBLISHED)


def labelled_roofs():
    """(type, points (n, 3)) of the labelled RoofN3D roofs."""
    for kind in ROOFN3D_TYPES:
        for path in sorted((SHARED / "roofn3d" / "labelled" / kind).glob("*.pts")):
            yield kind, np.loadtxt(path)[:, :3]


def best_type(types: dict[str, float]) -> str:
    return max(types, key=types.__getitem__)


def label_table(pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> Table:
    """IoU of each label over all points; the last label is "not roof"."""
    truth, found = (np.concatenate(column) for column in zip(*pairs, strict=True))
    names = (*TYPES, "not roof")
    rows = []
    for label, name in enumerate(names):
        both, either = (truth == label) & (found == label), (truth == label) | (found == label)
        rows.append((name, int((truth == label).sum()), float(both.sum() / either.sum()) if either.any() else None))
    known = [row[2] for row in rows if row[2] is not None]
    rows.append(("mean", len(truth), float(np.mean(known))))
    return Table("simulated: labels of points", ("label", "points", "IoU"), rows)


def type_tables(name: str, truth: Sequence[str], answers: Sequence[str]) -> list[Table]:
    """Accuracy, balanced accuracy and recalls, and the confusion matrix."""
    kinds = [kind for kind in TYPES if kind in truth]
    right = np.array([a == t for a, t in zip(answers, truth, strict=True)])
    truth_array = np.array(truth)
    recalls = {kind: float(right[truth_array == kind].mean()) for kind in kinds}
    rows = [("accuracy", float(right.mean())), ("balanced accuracy", float(np.mean(list(recalls.values()))))]
    rows += [(f"recall of {kind}", value) for kind, value in recalls.items()]
    columns = [kind for kind in TYPES if kind in truth or kind in answers]
    confusion = [(kind, *(count(truth, answers, kind, column) for column in columns)) for kind in kinds]
    figures = Table(f"{name}: roof types", ("figure", "value"), rows)
    return [figures, Table(f"{name}: true types (rows) and answers (columns)", ("true", *columns), confusion)]


def count(truth: Sequence[str], answers: Sequence[str], kind: str, answer: str) -> int:
    return sum(t == kind and a == answer for t, a in zip(truth, answers, strict=True))
