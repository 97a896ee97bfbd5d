"""The scope: logs and running machines in a browser."""
