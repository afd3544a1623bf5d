"""A run's own folder: whose run it holds, and what of it is done.

ledger        which tasks are done, what came of each building: SQLite
marks         by what a folder knows whose run it holds, and its lock: one run at a time
resume        a folder held against the request: gone on from, or begun anew
"""
