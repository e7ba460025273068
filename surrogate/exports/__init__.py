"""Surrogates as files that need no JAX: C, Fortran, NumPy, ONNX."""
