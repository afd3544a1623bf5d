"""Roof shapes: their contract, one shape a file, and the catalogue.

contract.py has the contract. halves.py makes halves of other shapes.
"""

from .catalogue import CATALOGUE, get
from .contract import Primitive

__all__ = ["CATALOGUE", "Primitive", "get"]
