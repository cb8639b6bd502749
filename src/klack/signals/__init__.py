"""Sampled signals and spectra, and the low pass of a sensor."""
