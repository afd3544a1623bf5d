"""The tiles' parts joined into the files of the output folder.

join          texts joined in plan order, and digests of what was written
"""
