"""Roof shapes: the contract (contract.py), one shape a file, halves of others (halves.py), the
catalogue.
"""

from .catalogue import CATALOGUE, get
from .contract import Primitive

__all__ = ["CATALOGUE", "Primitive", "get"]
