"""Schematics of valve networks: symbols, placement, wires, SVG."""
