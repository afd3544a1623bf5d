"""Fitting: `fit_roof` (single.py) fits one primitive by the likelihood (likelihood.py) or the paper's objective (paper.py)."""
