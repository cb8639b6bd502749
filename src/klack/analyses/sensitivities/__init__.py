"""Derivatives of measures with parameters."""
