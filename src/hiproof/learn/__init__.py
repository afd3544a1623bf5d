"""Training of the network that recognises roofs (extra `train`).

The package has the network, data sets, training and export.

    sample     a labelled cloud, what a source of them is, and random changes of clouds
    houses     houses made up for training, with annexes
    data       the source that a name stands for; RoofN3D; real shapes: solids with a roofType
    network    PointNet++ in PyTorch, and arranged clouds as its tensors
    training   the recipe, checkpoints and the best by validation
    export     to the ONNX file that `segment` runs; training curve and model card

The only room that imports torch, and not before `train` is asked for.
"""

from __future__ import annotations

from ..extras import import_extra

__all__ = ["TrainSettings", "train"]


def __getattr__(name: str):
    """Import `train` and `TrainSettings` on use; raises InputError without what they need."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    for package in ("torch", "onnx", "matplotlib"):
        import_extra(package, "train", "training")
    from . import training

    return getattr(training, name)
