"""Derivatives of the measures of a stroke with its parameters."""
