"""Compiled code: decorators, values in SIMD lanes, and reproducible elementary functions."""
