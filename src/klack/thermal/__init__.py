"""Heat: components of a thermal network, one per file; its exact steps, and slow warm-up."""
