"""A log of hours: which of its stretches tell most of the axes, and a diagnosis of those."""
