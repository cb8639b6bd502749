"""Elastic-plastic contact: bodies that yield under their own contact forces."""
