"""The parameters are the model: what is written of a building is enough to build it again, by hand or by program.

settle      a fitted roof made of exactly the numbers that are written of it
file        parameters.jsonl read line by line, its head and its errors by line and column
record      the JSON object of one building checked, and its parts made
building    the object built: composed, checked, measured, as a run does
run         a file of parameters into the files of a run
"""

from .building import build
from .file import read_parameters

__all__ = ["build", "read_parameters"]
