"""The tiles' parts joined into the files of the output folder.

join          texts joined in plan order
outputs       digests of what was written
"""
