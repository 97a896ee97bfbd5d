"""The physics of the gantry, compiled; it knows nothing of motorctl's models."""
