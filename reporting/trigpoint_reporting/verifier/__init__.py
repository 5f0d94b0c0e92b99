"""The verifier that every bundle carries: one file, which needs the standard library and NumPy."""
