"""Scores of trained controllers: on unseen terrains, from pushed starts, under faults."""
