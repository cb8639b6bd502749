"""Results that took long, kept on disk under a key of everything that they depend on."""
