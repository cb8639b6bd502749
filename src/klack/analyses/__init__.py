"""Kinds of question that a case can be asked, each with one answer."""
