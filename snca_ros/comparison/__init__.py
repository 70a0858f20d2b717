"""Comparison of types of controllers: statistical tests, tables, figures and a page."""
