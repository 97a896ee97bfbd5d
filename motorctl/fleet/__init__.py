"""Many machines, many days: every log looked at once, findings kept, and what changed when."""
