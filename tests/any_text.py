"""Any text. Hypothesis' own would look up the category of every character first: 3 s of CPU in each
process of a fresh clone.
"""

from hypothesis import strategies as st

CODES = st.one_of(st.integers(0, 127), st.integers(0, 0xFFFF), st.integers(0, 0x10FFFF))
ANY_TEXT = st.lists(CODES.map(chr), max_size=12).map("".join)
