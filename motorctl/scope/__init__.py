"""The scope: logs in a browser, from the whole recording down to single rows."""
