"""Show a diagnosis: on the terminal, as JSON, as a page with pictures, and what to do next."""
