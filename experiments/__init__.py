"""The paper's experiments, run again: one file a table or figure.

Run one by `python -m experiments NAME`.

Every module has `run(options) -> Result`; `__main__` chooses it by name, `output` writes what comes
back. Three methods stand side by side (`methods`): the paper's objective, the likelihood, and
RANSAC plane detection (`ransac`).
"""
