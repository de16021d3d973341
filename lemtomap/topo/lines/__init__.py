"""Which way the surfaces run on which points lie."""
