"""Recordings of walks: read from bags, made offline, measured, drawn."""
