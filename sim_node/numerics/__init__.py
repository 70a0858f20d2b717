"""Compiled code: the decorators, numbers in lanes, functions with the same bits everywhere."""
