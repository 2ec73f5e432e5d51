"""Allan analysis: noise parameters with confidence intervals from a record at rest."""
