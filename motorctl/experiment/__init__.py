"""The most telling experiment: what is still open, and which motion would settle it soonest."""
