"""The public Python API, handed on by `motorctl` itself: one file a subject."""
