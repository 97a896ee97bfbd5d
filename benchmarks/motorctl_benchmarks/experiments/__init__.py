"""Motion time until a diagnosis is certain: the rich motion beside motions that are chosen."""
