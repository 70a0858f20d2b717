"""Campaigns: many runs, which are evolved, assessed and collected in one table."""
