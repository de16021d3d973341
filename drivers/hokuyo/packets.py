"""Facts of SCIP 2."""
