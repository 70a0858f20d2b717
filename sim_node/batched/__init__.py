"""The batched engine: Munk2D's algorithm for many robots of one shape in SIMD lanes."""
