"""A numba integrator of its own: midpoint steps that solve friction exactly."""
