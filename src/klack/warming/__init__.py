"""Compile ahead: what a command will need, in processes of their own."""
