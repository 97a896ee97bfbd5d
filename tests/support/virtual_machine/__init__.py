"""A small Debian in an emulated machine, for tests that need a kernel of their own."""
