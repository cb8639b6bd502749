"""Elastic bodies: matrices, modes and reduced models, model files, gauges."""
