"""Point clouds from LAS, LAZ, COPC, text and PLY files, in chunks."""
