"""Analyses of a case, one folder each."""
