"""A crowd of clients and fuzzed bytes on the control socket, and what the loop notices of it."""
