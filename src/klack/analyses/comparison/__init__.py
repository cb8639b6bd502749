"""Results beside measurements and beside CalculiX."""
