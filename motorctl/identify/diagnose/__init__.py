"""Find what the declared model does not explain, and trace it to the effect that it lacks."""
