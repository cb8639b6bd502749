"""Charts, the self-contained report in HTML and PDF."""
