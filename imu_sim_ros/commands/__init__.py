"""Arguments and printing; one file per program."""
