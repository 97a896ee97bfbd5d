"""The public Python API, which motorctl itself hands on: one file a subject."""
