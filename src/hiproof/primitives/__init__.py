"""Roof shapes: the contract (contract.py), one shape a file, and the catalogue that names them."""

from .catalogue import CATALOGUE, get
from .contract import Primitive

__all__ = ["CATALOGUE", "Primitive", "get"]
