"""The processes of one robot: described, started, watched, ended."""
