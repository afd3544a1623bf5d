"""`python -m hiproof`: the command line."""

from .cli import main

main()
