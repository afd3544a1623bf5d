"""Names, units and codes that input files use, by data/reading.toml."""

from ..data_files import read_data_file

READING = read_data_file("reading")
