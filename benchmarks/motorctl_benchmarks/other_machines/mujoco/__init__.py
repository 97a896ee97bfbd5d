"""The rigid-body engine MuJoCo."""
