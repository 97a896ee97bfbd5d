"""From a recording to the columns and rows of a regression, for fit and diagnosis alike."""
