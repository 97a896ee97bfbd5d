"""Search for the effects that, together, explain what the declared model leaves."""
