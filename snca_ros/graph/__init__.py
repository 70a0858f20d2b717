"""The processes of one robot: their description, start, supervision and end."""
