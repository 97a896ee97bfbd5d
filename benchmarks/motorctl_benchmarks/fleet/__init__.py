"""A simulated fleet: machines that wear over weeks, and what `motorctl fleet` tells of them."""
