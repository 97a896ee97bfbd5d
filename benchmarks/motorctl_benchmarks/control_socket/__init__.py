"""The control socket under a crowd of clients and fuzzed bytes: does the loop notice?"""
