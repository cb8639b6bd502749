"""Archives of ANSYS MAPDL."""
