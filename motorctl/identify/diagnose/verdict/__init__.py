"""Judge what a search found: errors on held-out rows, confidence, and one of four verdicts."""
