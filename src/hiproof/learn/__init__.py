"""Training of the network that recognises roofs (extra `train`): network, data sets, training, export.

The only room that imports torch. `train` makes weights, `segment` uses them.
"""

from __future__ import annotations

from ..errors import InputError

try:
    import torch as _torch  # noqa: F401
except ImportError as error:
    raise InputError(
        "expected PyTorch for training, but it is not installed; install hiproof with the extra: pip install 'hiproof[train]'"
    ) from error

from .training import TrainSettings, train

__all__ = ["TrainSettings", "train"]
