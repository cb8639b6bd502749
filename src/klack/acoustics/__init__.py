"""Spectra, bands and levels."""
