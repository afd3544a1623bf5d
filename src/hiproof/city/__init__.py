"""Many buildings: an area becomes tasks, tasks become part files, part files become the output.

    plan    which buildings there are, which work tile owns each, which point files there are      plan.py
    sort    each point file, read once in chunks, leaves the points each work tile needs           sort.py
    solve   each work tile reconstructs its own buildings and writes them as text, ready to join   solve.py
    merge   the tiles' parts are joined in plan order into the files of the output folder          merge.py

A building is owned by one tile and sees all points in and around its footprint from all files, in an order of its own:
its answer does not depend on how the area was cut. Tasks are idempotent and write whole files or none; the ledger
(ledger.py) says which are done, so a run that was killed goes on where it stopped. Where tasks run (this process,
processes, a Dask cluster) is an executor's business (executors.py).
"""
