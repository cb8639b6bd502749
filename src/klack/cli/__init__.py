"""The klack command."""
