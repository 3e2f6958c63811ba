"""`python -m softreach`."""

from softreach.cli import main

main()
