"""Compare runs: the published measures of each, before and after, and their pictures."""
