"""The files each consumer wants beside a bag; one file per stack."""
