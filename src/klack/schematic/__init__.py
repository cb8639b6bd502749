"""Schematics of valve networks: symbols, their placement, wires, and the picture as SVG."""
