"""A run's own folder: whose run it holds, and what of it is done.

lock          one run a folder at a time
ledger        which tasks are done, what came of each building: SQLite
marks         by what a folder knows whose run it holds
resume        a folder held against the request: gone on from, or begun anew
digests       by what a building is known to be the same
"""
