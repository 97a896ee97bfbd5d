"""A 64-bit ARM processor, emulated program by program, for tests of the compiled loop on it."""
