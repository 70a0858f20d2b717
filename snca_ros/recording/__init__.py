"""Recordings of walks: reads bags, records offline walks, measures and draws gaits."""
