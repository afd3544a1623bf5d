"""Recognising a roof before its fit.

The shipped PointNet++ runs in ONNX Runtime, and takes part in the choice of type.

sampling    farthest points and ball neighbours, compiled
arrange     a cloud in its canonical frame, as the network takes it (shared with training)
inference   the session and `segment`
files       `hiproof segment`: clouds in, labels out
posterior   `combine`: the network's prior times the fits' evidence, and stand-ins of types
scores      figures of a classification
"""

from __future__ import annotations

from .inference import NOT_ROOF, Segmentation, segment
from .posterior import choose_most_probable, combine

__all__ = ["NOT_ROOF", "Segmentation", "choose_most_probable", "combine", "segment"]
