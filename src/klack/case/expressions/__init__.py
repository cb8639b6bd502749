"""Arithmetic of quantities as text, with its dimensions; nothing of a text is ever run."""
