"""Compiled parts of the simulated axes: apart, so that what they compile to is kept."""
