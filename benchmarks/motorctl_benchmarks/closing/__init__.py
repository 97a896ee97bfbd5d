"""The loop closed through a bus and a daemon, beside the same in virtual time."""
