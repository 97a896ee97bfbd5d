"""A blind campaign: simulated machines with known causes, diagnosed from their logs alone."""
