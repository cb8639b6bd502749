"""Bodies that yield under their own contact forces."""
