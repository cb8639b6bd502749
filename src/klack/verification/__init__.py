"""Exact and published cases that klack checks itself against."""
