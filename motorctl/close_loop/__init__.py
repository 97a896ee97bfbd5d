"""Close the loop: simulate, diagnose, refine, simulate again, and keep only what helps."""
