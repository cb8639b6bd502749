"""Bulk data of Nastran."""
